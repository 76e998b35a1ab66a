//! Objects of a file: from a section each, or from compact descriptions.

use std::collections::HashSet;

use crate::eds::ini::Ini;
use crate::eds::read::{is_head, one};
use crate::eds::title::Title;
use crate::eds::{EdsError, EdsObject, compact};
use crate::object::Object;

/// Maximum number of objects, and maximum bytes copied for compact descriptions, which could expand to any
/// number.
const MAX_OBJECTS: usize = 100_000;
const MAX_COPIED: usize = 32 << 20;

/// Objects of a file, by index and sub-index.
///
/// # Errors
/// Returns an error for no objects, or too many.
pub(super) fn objects(ini: &Ini<'_>) -> Result<Vec<EdsObject>, EdsError> {
    let heads = with_sub_sections(ini);
    let mut objects = Vec::new();
    let mut copied = 0;
    for section in ini.first_sections() {
        match section.title {
            Title::Sub(index, sub) => objects.push(one(ini, section, Object { index, sub })),
            Title::Object(index) => match compact::count(section) {
                0 if heads.contains(&index) || is_head(section) => {}
                0 => objects.push(one(ini, section, Object { index, sub: 0 })),
                count => {
                    copied += usize::from(count) * section.bytes();
                    if copied > MAX_COPIED {
                        return Err(EdsError::TooMany);
                    }
                    compact::array(ini, section, index, count, &mut objects);
                }
            },
            Title::Named(_)
            | Title::Names(_)
            | Title::Values(_)
            | Title::Denotations(_)
            | Title::Links(_)
            | Title::Other(_) => {}
        }
        check_count(&objects)?;
    }
    compact::pdos(ini, &mut objects);
    check_count(&objects)?;
    objects.sort_by_key(|described| described.object);
    if objects.is_empty() { Err(EdsError::Empty) } else { Ok(objects) }
}

fn check_count(objects: &[EdsObject]) -> Result<(), EdsError> {
    if objects.len() > MAX_OBJECTS { Err(EdsError::TooMany) } else { Ok(()) }
}

/// Objects that have sections for their sub-indices.
fn with_sub_sections(ini: &Ini<'_>) -> HashSet<u16> {
    let mut heads = HashSet::new();
    for section in ini.first_sections() {
        if let Title::Sub(index, _) = section.title {
            heads.insert(index);
        }
    }
    heads
}
