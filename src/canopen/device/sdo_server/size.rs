//! How long a value must be.

use crate::abort::AbortCode;
use crate::sdo::MAX_BYTES;

/// Whether `found` bytes are what an object of this size takes.
pub(super) fn check_size(size: Option<usize>, found: usize) -> Result<(), AbortCode> {
    match size {
        Some(size) if found > size => Err(AbortCode::LENGTH_TOO_HIGH),
        Some(size) if found < size => Err(AbortCode::LENGTH_TOO_LOW),
        None if found > MAX_BYTES => Err(AbortCode::OUT_OF_MEMORY),
        Some(_) | None => Ok(()),
    }
}
