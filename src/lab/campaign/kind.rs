//! A kind of fault: its name, the hazard it stands for, the causes that may stop the node first.

use crate::campaign::draw::Draw;
use crate::campaign::injection::Injection;
use crate::campaign::injection::Place;
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
    pub(super) injection: MakeInjection,
}

/// Draws a case of one kind from chance.
type MakeInjection = fn(&mut Draw, &Place<'_>) -> Injection;

/// The list of causes of a fault that must not stop the node, or only disengages it.
pub(super) const NO_CAUSE: &[Cause] = &[];

impl std::fmt::Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (row {})", self.name, self.row)
    }
}

/// In any situation.
pub(super) const fn kind(
    row: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, row, causes, situations: &Situation::ALL, injection }
}

/// Only while the arm is carried, with the deadman open.
pub(super) const fn armed(
    row: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, row, causes, situations: &[Situation::Armed], injection }
}

/// Only while the deadman is held.
pub(super) const fn engaged(
    row: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, row, causes, situations: &Situation::ENGAGED, injection }
}

/// Only while the hand rests against something.
pub(super) const fn in_contact(
    row: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, row, causes, situations: &[Situation::Contact], injection }
}
