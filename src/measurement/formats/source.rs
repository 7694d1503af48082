//! Where a file's bytes come from: a regular file, which is read in place, or a stream (stdin, a pipe), which is read whole
//! first because its format has to be sniffed.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::measurement::MeasurementError;

/// Most bytes taken from a stream, whose length nobody knows beforehand: 1 GiB, thirty times a MERL table.
const STREAM_LIMIT: u64 = 1 << 30;

/// An input whose length is known.
#[derive(Debug)]
pub(super) struct Source {
    /// What messages call it.
    path: PathBuf,
    content: Content,
}

#[derive(Debug)]
enum Content {
    File { len: u64 },
    Memory(Vec<u8>),
}

impl Source {
    /// Opens `path`; `-` is stdin. Streams are read whole, at most [`STREAM_LIMIT`] bytes.
    pub(super) fn open(path: &Path) -> Result<Self, MeasurementError> {
        if path == Path::new("-") {
            return Self::from_stream(Path::new("stdin"), std::io::stdin().lock(), STREAM_LIMIT);
        }
        let metadata = std::fs::metadata(path).map_err(|e| MeasurementError::io(path, e))?;
        if metadata.is_dir() {
            return Err(MeasurementError::invalid(path, "the path", "a measurement file", "a directory"));
        }
        if metadata.is_file() {
            return Ok(Self { path: path.into(), content: Content::File { len: metadata.len() } });
        }
        let stream = File::open(path).map_err(|e| MeasurementError::io(path, e))?;
        Self::from_stream(path, stream, STREAM_LIMIT)
    }

    /// Reads `stream` whole; more than `limit` bytes are refused.
    pub(super) fn from_stream(path: &Path, stream: impl Read, limit: u64) -> Result<Self, MeasurementError> {
        let mut bytes = Vec::new();
        stream.take(limit + 1).read_to_end(&mut bytes).map_err(|e| MeasurementError::io(path, e))?;
        if bytes.len() as u64 > limit {
            let reason = format!("a stream of more than {limit} bytes is not read; save it to a file");
            return Err(MeasurementError::unsupported(path, reason));
        }
        Ok(Self::from_bytes(path, bytes))
    }

    /// An input held in memory; `-` is stdin.
    pub(super) fn from_bytes(path: &Path, bytes: Vec<u8>) -> Self {
        let path = if path == Path::new("-") { Path::new("stdin") } else { path };
        Self { path: path.into(), content: Content::Memory(bytes) }
    }

    /// The bytes of a stream; `None` for a regular file.
    pub(super) fn into_stream(self) -> Option<Vec<u8>> {
        match self.content {
            Content::File { .. } => None,
            Content::Memory(bytes) => Some(bytes),
        }
    }

    /// What messages call it.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The measurement's name: the file's stem.
    pub(super) fn name(&self) -> String {
        self.path.file_stem().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned()
    }

    /// Bytes in all.
    pub(super) fn len(&self) -> u64 {
        match &self.content {
            Content::File { len } => *len,
            Content::Memory(bytes) => bytes.len() as u64,
        }
    }

    /// The first bytes, at most `limit`.
    pub(super) fn head(&self, limit: usize) -> Result<Vec<u8>, MeasurementError> {
        let mut head = Vec::new();
        self.reader_at(0)?
            .take(limit as u64)
            .read_to_end(&mut head)
            .map_err(|e| MeasurementError::io(&self.path, e))?;
        Ok(head)
    }

    /// All bytes, at most [`STREAM_LIMIT`].
    pub(super) fn whole(&self) -> Result<Vec<u8>, MeasurementError> {
        if self.len() > STREAM_LIMIT {
            let reason = format!("{} bytes are more than the {STREAM_LIMIT} that are read at once", self.len());
            return Err(MeasurementError::unsupported(&self.path, reason));
        }
        self.head(usize::MAX)
    }

    /// A reader of its own that starts at byte `offset`.
    pub(super) fn reader_at(&self, offset: u64) -> Result<Box<dyn BufRead + '_>, MeasurementError> {
        match &self.content {
            Content::File { .. } => Ok(Box::new(BufReader::with_capacity(1 << 16, self.file_at(offset)?))),
            Content::Memory(bytes) => {
                let start = usize::try_from(offset).unwrap_or(usize::MAX).min(bytes.len());
                Ok(Box::new(bytes.get(start..).unwrap_or_default()))
            }
        }
    }

    /// Fills `buffer` with the bytes from `offset` on.
    pub(super) fn read_exact_at(
        &self,
        handle: &mut Option<File>,
        offset: u64,
        buffer: &mut [u8],
    ) -> Result<(), MeasurementError> {
        let io = |e| MeasurementError::io(&self.path, e);
        if let Content::Memory(_) = self.content {
            return self.reader_at(offset)?.read_exact(buffer).map_err(io);
        }
        let file = match handle {
            Some(file) => file,
            None => handle.insert(File::open(&self.path).map_err(io)?),
        };
        file.seek(SeekFrom::Start(offset)).and_then(|_| file.read_exact(buffer)).map_err(io)
    }

    fn file_at(&self, offset: u64) -> Result<File, MeasurementError> {
        let io = |e| MeasurementError::io(&self.path, e);
        let mut file = File::open(&self.path).map_err(io)?;
        file.seek(SeekFrom::Start(offset)).map_err(io)?;
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_without_end_is_refused_at_the_limit() {
        let error = Source::from_stream(Path::new("stdin"), std::io::repeat(b'1'), 1000).expect_err("endless");
        assert!(error.to_string().contains("more than 1000 bytes"), "{error}");
        let whole = Source::from_stream(Path::new("stdin"), &b"abc"[..], 3).expect("fits");
        assert_eq!((whole.len(), whole.head(2).expect("head")), (3, b"ab".to_vec()));
        assert_eq!(whole.into_stream(), Some(b"abc".to_vec()));
        assert_eq!(Source::from_bytes(Path::new("-"), Vec::new()).name(), "stdin");
    }

    #[test]
    fn a_directory_is_named_as_one() {
        let error = Source::open(Path::new(env!("CARGO_MANIFEST_DIR"))).expect_err("directory");
        assert!(error.to_string().contains("found a directory"), "{error}");
    }
}
