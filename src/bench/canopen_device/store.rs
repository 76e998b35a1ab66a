//! Non-volatile parameters of a device: "save" (1010h), "load" (1011h) and configuration stamp (1020h); CiA 301,
//! 7.5.2.13, 7.5.2.14, 7.5.2.23.
//!
//! Stored are all writable parameters except set-points and the error history. A write that makes the device
//! differ from its stored parameters clears the stamp.

use crate::dictionary::Dictionary;
use canopen::abort::AbortCode;
use canopen::eds::Access;
use canopen::object::Object;

/// Checks the signature of a write to 1010h or 1011h; other objects pass.
///
/// # Errors
/// Returns an abort code for a wrong signature.
pub(super) fn check_write(object: Object, value: u32) -> Result<(), AbortCode> {
    let signature = match object {
        Object::STORE_PARAMETERS => SAVE,
        Object::RESTORE_DEFAULTS => LOAD,
        _ => return Ok(()),
    };
    if value == signature { Ok(()) } else { Err(AbortCode::NOT_STORED) }
}

/// Executes a store or restore command; clears the stamp after other changes.
pub(super) fn apply(object: Object, dictionary: &mut Dictionary) {
    match object {
        Object::STORE_PARAMETERS => {
            dictionary.set(object, &ON_COMMAND);
            dictionary.keep(is_kept);
        }
        Object::RESTORE_DEFAULTS => {
            dictionary.set(object, &ON_COMMAND);
            dictionary.forget(is_kept);
        }
        Object::CONFIGURATION_DATE | Object::CONFIGURATION_TIME => {}
        _ if is_changed(object, dictionary) => {
            for part in [Object::CONFIGURATION_DATE, Object::CONFIGURATION_TIME] {
                dictionary.set(part, &[0; 4]);
            }
        }
        _ => {}
    }
}

/// Returns whether an object is stored and differs from its stored value.
fn is_changed(object: Object, dictionary: &Dictionary) -> bool {
    let Some(entry) = dictionary.entry(object) else { return false };
    is_kept(object, entry.access) && entry.value() != entry.default()
}

/// Returns whether an object is stored.
fn is_kept(object: Object, access: Access) -> bool {
    let is_parameter = match access {
        Access::ReadWrite | Access::ReadWriteInput => true,
        // Set-points, and objects without write access.
        Access::ReadWriteOutput | Access::WriteOnly | Access::ReadOnly | Access::Constant => false,
    };
    is_parameter && !NOT_KEPT.contains(&object.index)
}

/// Excluded objects: the history records the past; 1010h and 1011h are commands.
const NOT_KEPT: [u16; 3] =
    [Object::ERROR_HISTORY.index, Object::STORE_PARAMETERS.index, Object::RESTORE_DEFAULTS.index];

/// Value of 1010h and 1011h: stores and restores on command.
const ON_COMMAND: [u8; 4] = [1, 0, 0, 0];
/// Signature of 1010h.
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Signature of 1011h.
const LOAD: u32 = u32::from_le_bytes(*b"load");
