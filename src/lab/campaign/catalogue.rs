//! Every kind of fault, the row of the hazard table it stands for, and what is expected of the node.
//!
//! Expectations are those of the table; where a configuration sets the time, they follow it. So are the causes that
//! may stop the node first: they are written here by hand, from docs/safety.md, and not taken from the node's own
//! table, which they judge. The kinds are taken by turns, so that a case's number says its kind.

mod buses;
mod devices;
mod frames;
mod people;

use crate::campaign::kind::Kind;

/// All of them, in the order of the hazard table.
pub fn kinds() -> impl Iterator<Item = &'static Kind> {
    let groups: [&[Kind]; 4] = [devices::KINDS, frames::KINDS, buses::KINDS, people::KINDS];
    groups.into_iter().flatten()
}

/// The kind of case `number`, from 1.
pub(super) fn kind_of(number: u32) -> Option<&'static Kind> {
    let count = kinds().count();
    let place = usize::try_from(number).ok()?.checked_sub(1)?;
    kinds().nth(place.checked_rem(count)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use node::cause::Kind as Cause;

    #[test]
    fn cause_that_is_demanded_alone_is_of_the_hazard_it_is_demanded_for() {
        for cause in Cause::ALL {
            let mut alone = kinds().filter(|kind| kind.causes == [cause]).peekable();
            let is_its = |kind: &Kind| cause.row().hazards.contains(&kind.row);
            assert!(alone.peek().is_none() || alone.any(is_its), "{cause:?}");
        }
    }
}
