//! The errors of the past (1003h): CiA 301, 7.5.2.4. The newest is the first.

use crate::device::mapping::byte;
use crate::dictionary::Dictionary;
use crate::object::Object;

/// Whether a sub-index is one of an error that has not happened yet.
pub(super) fn is_empty_at(dictionary: &Dictionary, object: Object) -> bool {
    object.index == Object::ERROR_HISTORY.index
        && object.sub > byte(dictionary, Object::ERROR_HISTORY)
}

/// Puts an error at the head of the history, as far as there is one; the oldest falls out.
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

/// Forgets every error of the past.
pub(super) fn clear(dictionary: &mut Dictionary) {
    dictionary.set(Object::ERROR_HISTORY, &[0]);
    let mut sub = 1;
    while let Some(object) = place(dictionary, sub) {
        dictionary.set(object, &[0; 4]);
        sub = sub.saturating_add(1);
    }
}

/// The `sub`-th error of the past, up to 254.
fn place(dictionary: &Dictionary, sub: u8) -> Option<Object> {
    let object = Object { sub, ..Object::ERROR_HISTORY };
    dictionary.entry(object).filter(|_| sub < u8::MAX).map(|_| object)
}
