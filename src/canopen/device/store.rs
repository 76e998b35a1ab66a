//! What a device keeps without power: "save" (1010h), "load" (1011h) and the stamp of its configuration
//! (1020h); CiA 301, 7.5.2.13, 7.5.2.14, 7.5.2.23.
//!
//! Kept is every parameter that may be written, but for set-points and the error history. The stamp is
//! void as soon as another write makes the device differ from what it has kept.

use crate::abort::AbortCode;
use crate::dictionary::Dictionary;
use crate::eds::Access;
use crate::object::Object;

/// Whether a signature may be written to 1010h or 1011h; other objects are none of its business.
///
/// # Errors
/// For another signature than the object's own.
pub(super) fn check_write(object: Object, value: u32) -> Result<(), AbortCode> {
    let signature = match object {
        Object::STORE_PARAMETERS => SAVE,
        Object::RESTORE_DEFAULTS => LOAD,
        _ => return Ok(()),
    };
    if value == signature { Ok(()) } else { Err(AbortCode::NOT_STORED) }
}

/// Does as a write to `object` asks, or what follows from it for what is kept.
pub(super) fn follow(object: Object, dictionary: &mut Dictionary) {
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

/// Whether an object is among what is kept, and differs from it.
fn is_changed(object: Object, dictionary: &Dictionary) -> bool {
    let Some(entry) = dictionary.entry(object) else { return false };
    is_kept(object, entry.access) && entry.value() != entry.default()
}

/// Whether an object is kept without power.
fn is_kept(object: Object, access: Access) -> bool {
    let is_parameter = match access {
        Access::ReadWrite | Access::ReadWriteInput => true,
        // Set-points, and what cannot be set.
        Access::ReadWriteOutput | Access::WriteOnly | Access::ReadOnly | Access::Constant => false,
    };
    is_parameter && !NOT_KEPT.contains(&object.index)
}

/// The history is of the past, and 1010h and 1011h are commands.
const NOT_KEPT: [u16; 3] =
    [Object::ERROR_HISTORY.index, Object::STORE_PARAMETERS.index, Object::RESTORE_DEFAULTS.index];

/// What 1010h and 1011h read: it is done on command.
const ON_COMMAND: [u8; 4] = [1, 0, 0, 0];
/// The signature of 1010h.
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// The signature of 1011h.
const LOAD: u32 = u32::from_le_bytes(*b"load");
