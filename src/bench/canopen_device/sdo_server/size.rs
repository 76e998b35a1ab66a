//! Required size of a value.

use canopen::abort::AbortCode;
use canopen::sdo::MAX_BYTES;

/// Checks that an object of `size` accepts `found` bytes.
pub(super) fn check_size(size: Option<usize>, found: usize) -> Result<(), AbortCode> {
    match size {
        Some(size) if found > size => Err(AbortCode::LENGTH_TOO_HIGH),
        Some(size) if found < size => Err(AbortCode::LENGTH_TOO_LOW),
        None if found > MAX_BYTES => Err(AbortCode::OUT_OF_MEMORY),
        Some(_) | None => Ok(()),
    }
}
