//! Which objects a file describes: by a section each, or many at once.

use std::collections::HashSet;

use crate::eds::Described;
use crate::eds::EdsError;
use crate::eds::compact;
use crate::eds::ini::Ini;
use crate::eds::read::is_head;
use crate::eds::read::one;
use crate::eds::title::Title;
use crate::object::Object;

/// More objects than any device has, and more bytes than their descriptions take: what is told
/// compactly could be any number.
const MOST_OBJECTS: usize = 100_000;
const MOST_COPIED: usize = 32 << 20;

/// Every object a file describes, by index and sub-index.
///
/// # Errors
/// When there are none or too many.
pub(super) fn objects(ini: &Ini<'_>) -> Result<Vec<Described>, EdsError> {
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
                    if copied > MOST_COPIED {
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
        enough(&objects)?;
    }
    compact::pdos(ini, &mut objects);
    enough(&objects)?;
    objects.sort_by_key(|described| described.object);
    if objects.is_empty() { Err(EdsError::Empty) } else { Ok(objects) }
}

fn enough(objects: &[Described]) -> Result<(), EdsError> {
    if objects.len() > MOST_OBJECTS { Err(EdsError::TooMany) } else { Ok(()) }
}

/// The objects that have sections for their sub-indices.
fn with_sub_sections(ini: &Ini<'_>) -> HashSet<u16> {
    let mut heads = HashSet::new();
    for section in ini.first_sections() {
        if let Title::Sub(index, _) = section.title {
            heads.insert(index);
        }
    }
    heads
}
