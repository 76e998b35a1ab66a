//! Every kind of fault, the row of the hazard table it stands for, and what is demanded of it.
//!
//! Demands are those of the table; where a configuration sets the time, they follow it. So are the causes that
//! may stop the node first: they are written here by hand, from docs/safety.md, and not taken from the node's own
//! table, which they judge. The kinds are taken by turns, so that a case's number says its kind.

mod buses;
mod devices;
mod frames;
mod people;

use crate::campaign::case::Deed;
use crate::campaign::case::Place;
use crate::campaign::draw::Draw;
use crate::campaign::situation::Situation;
use node::cause::Kind as Cause;

/// The kind by which a node is killed: its figures are those of the drives' own timers.
pub(super) const KILLED: &str = "process killed";

/// A kind of fault.
#[derive(Clone, Copy)]
pub struct Kind {
    /// How it is called.
    pub name: &'static str,
    /// The hazard it stands for.
    pub row: u8,
    /// Causes that may stop the node first; any other is a wrong cause.
    pub(super) causes: &'static [Cause],
    /// In which situations it means anything.
    pub(super) situations: &'static [Situation],
    /// What is done, drawn from chance.
    pub(super) deed: MakeDeed,
}

/// Draws a case of one kind from chance.
type MakeDeed = fn(&mut Draw, &Place<'_>) -> Deed;

/// The list of causes of a fault that must not stop the node, or only disengages it.
const NO_CAUSE: &[Cause] = &[];

impl std::fmt::Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (row {})", self.name, self.row)
    }
}

/// In any situation.
const fn kind(row: u8, name: &'static str, causes: &'static [Cause], deed: MakeDeed) -> Kind {
    Kind { name, row, causes, situations: &Situation::ALL, deed }
}

/// Only while the arm is carried, with the deadman open.
const fn armed(row: u8, name: &'static str, causes: &'static [Cause], deed: MakeDeed) -> Kind {
    Kind { name, row, causes, situations: &[Situation::Armed], deed }
}

/// Only while the deadman is held.
const fn engaged(row: u8, name: &'static str, causes: &'static [Cause], deed: MakeDeed) -> Kind {
    Kind { name, row, causes, situations: &Situation::ENGAGED, deed }
}

/// Only while the hand rests against something.
const fn in_contact(row: u8, name: &'static str, causes: &'static [Cause], deed: MakeDeed) -> Kind {
    Kind { name, row, causes, situations: &[Situation::Contact], deed }
}

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
    use node::safety::table;

    #[test]
    fn cause_that_is_demanded_alone_is_of_the_hazard_it_is_demanded_for() {
        for cause in Cause::ALL {
            let mut alone = kinds().filter(|kind| kind.causes == [cause]).peekable();
            let is_its = |kind: &Kind| table::row(cause).hazards.contains(&kind.row);
            assert!(alone.peek().is_none() || alone.any(is_its), "{cause:?}");
        }
    }
}
