//! Output files that appear whole or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a file by way of a temporary one in the same folder, which takes its place only when `write` has succeeded. An
/// existing file keeps its content until then. Something that is not a plain file (a device, a pipe) is written directly.
///
/// # Errors
/// What `write` returns, and what the disk answers.
pub fn write_whole<T, E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<T, E>,
) -> Result<T, E> {
    let target = resolve_links(path);
    if fs::metadata(&target).is_ok_and(|m| !m.is_file()) {
        let mut out = BufWriter::new(fs::OpenOptions::new().write(true).open(&target)?);
        let result = write(&mut out)?;
        out.flush()?;
        return Ok(result);
    }
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".goniofit-");
    #[cfg(unix)]
    {
        // The rights that any new file gets; temporary files are private otherwise.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut out = BufWriter::new(builder.tempfile_in(folder)?);
    let result = write(&mut out)?;
    let file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.persist(&target).map_err(|e| e.error)?;
    Ok(result)
}

/// The file that a path leads to: a link's target rather than the link is replaced.
fn resolve_links(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("out.txt");
        write_whole::<_, io::Error>(&path, |w| w.write_all(b"first")).expect("writes");
        let failed = write_whole::<(), io::Error>(&path, |w| {
            w.write_all(b"second")?;
            Err(io::Error::other("no"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).expect("reads"), b"first");
        assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_links_are_written_through() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        write_whole::<_, io::Error>(Path::new("/dev/null"), |w| w.write_all(b"x")).expect("writes");
        assert!(fs::metadata("/dev/null").expect("is there").file_type().is_char_device());
        let folder = tempfile::tempdir().expect("a folder");
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "old").expect("writes");
        symlink(&real, &link).expect("links");
        write_whole::<_, io::Error>(&link, |w| w.write_all(b"new")).expect("writes");
        assert_eq!(fs::read(&real).expect("reads"), b"new");
        assert!(fs::symlink_metadata(&link).expect("is there").is_symlink());
    }
}
