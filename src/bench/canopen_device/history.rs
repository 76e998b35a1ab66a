//! Error history (1003h): CiA 301, 7.5.2.4. Sub-index 1 is the newest error.

use crate::dictionary::Dictionary;
use crate::mapping::byte;
use canopen::object::Object;

/// Returns whether a sub-index holds no error yet.
pub(super) fn is_empty_at(dictionary: &Dictionary, object: Object) -> bool {
    object.index == Object::ERROR_HISTORY.index
        && object.sub > byte(dictionary, Object::ERROR_HISTORY)
}

/// Records an error as the newest; the oldest is dropped.
pub(super) fn remember(code: u16, dictionary: &mut Dictionary) {
    let count = byte(dictionary, Object::ERROR_HISTORY);
    let (mut next, mut sub) = (u32::from(code), 1);
    while let Some(object) = place(dictionary, sub) {
        let pushed_on = dictionary.unsigned(object);
        dictionary.set(object, &next.to_le_bytes());
        if sub > count {
            dictionary.set(Object::ERROR_HISTORY, &[sub]);
            return;
        }
        next = pushed_on;
        sub = sub.saturating_add(1);
    }
}

/// Clears the history.
pub(super) fn clear(dictionary: &mut Dictionary) {
    dictionary.set(Object::ERROR_HISTORY, &[0]);
    let mut sub = 1;
    while let Some(object) = place(dictionary, sub) {
        dictionary.set(object, &[0; 4]);
        sub = sub.saturating_add(1);
    }
}

/// Object of the `sub`-th error, up to 254.
fn place(dictionary: &Dictionary, sub: u8) -> Option<Object> {
    let object = Object { sub, ..Object::ERROR_HISTORY };
    dictionary.entry(object).filter(|_| sub < u8::MAX).map(|_| object)
}
