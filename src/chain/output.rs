//! Output files of the chain.

use std::path::Path;

use super::error::ChainError;
use crate::control::write_whole;

/// Writes a file whole.
pub(super) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ChainError> {
    write_whole::<_, std::io::Error>(path, |w| w.write_all(bytes)).map_err(|e| ChainError::write(path, e))
}
