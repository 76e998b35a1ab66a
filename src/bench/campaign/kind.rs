//! A kind of fault of the campaign: name, hazard, situations, causes that may stop the node first.

use crate::injection::{Conditions, Injection};
use crate::random::Random;
use crate::situation::Situation;
use node::cause::Kind as Cause;

/// The kind by which a node is killed: its figures are those of the drives' own timers.
pub(super) const KILLED: &str = "process killed";

/// A kind of fault.
#[derive(Clone, Copy)]
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// Number of the hazard in docs/safety.md.
    pub hazard: u8,
    /// Causes that may stop the node first; any other is a wrong cause.
    pub(super) causes: &'static [Cause],
    /// Situations in which it is injected.
    pub(super) situations: &'static [Situation],
    /// Makes a case from random numbers.
    pub(super) injection: MakeInjection,
}

/// Makes a case of one kind from random numbers.
type MakeInjection = fn(&mut Random, &Conditions<'_>) -> Injection;

/// The causes of a fault that must not stop the node, or only disengages it.
pub(super) const NO_CAUSE: &[Cause] = &[];

impl std::fmt::Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (hazard {})", self.name, self.hazard)
    }
}

/// A kind that is injected before the operator has armed.
pub(super) const fn ready(
    hazard: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, hazard, causes, situations: &[Situation::Ready], injection }
}

/// A kind that is injected in any situation in which the arm is carried.
pub(super) const fn kind(
    hazard: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, hazard, causes, situations: &Situation::ARMED, injection }
}

/// A kind that is injected while the arm is armed with the deadman open.
pub(super) const fn armed(
    hazard: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, hazard, causes, situations: &[Situation::Armed], injection }
}

/// A kind that is injected while the deadman is pressed.
pub(super) const fn engaged(
    hazard: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, hazard, causes, situations: &Situation::ENGAGED, injection }
}

/// A kind that is injected while the object presses against the wall.
pub(super) const fn in_contact(
    hazard: u8,
    name: &'static str,
    causes: &'static [Cause],
    injection: MakeInjection,
) -> Kind {
    Kind { name, hazard, causes, situations: &[Situation::Contact], injection }
}
