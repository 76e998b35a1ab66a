//! Kind of fault of the campaign: name, hazard, situations, and causes that may stop the node first.

use crate::injection::{Conditions, Injection};
use crate::random::Random;
use crate::situation::Situation;
use node::cause::CauseKind;

/// Name of the kind that kills the node; its figures are those of the drives' timers.
pub(super) const KILLED: &str = "process killed";

/// Kind of fault.
#[derive(Clone, Copy)]
pub struct CaseKind {
    /// Name in tables, and of `--only`.
    pub name: &'static str,
    /// Number of the hazard in docs/safety.md.
    pub hazard: u8,
    /// Causes that may stop the node first; any other is a wrong cause.
    pub(super) causes: &'static [CauseKind],
    /// Situations in which it is injected.
    pub(super) situations: &'static [Situation],
    /// Draws an injection.
    pub(super) injection: MakeInjection,
}

/// Function that draws an injection of one kind.
type MakeInjection = fn(&mut Random, &Conditions<'_>) -> Injection;

/// Causes of a fault that must not stop the node, or that only disengages it.
pub(super) const NO_CAUSE: &[CauseKind] = &[];

impl std::fmt::Debug for CaseKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (hazard {})", self.name, self.hazard)
    }
}

/// Creates a kind that is injected before the operator has armed.
pub(super) const fn ready(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &[Situation::Ready], injection }
}

/// Creates a kind that is injected while armed, after the zeros were set.
pub(super) const fn zeroed(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &[Situation::Zeroed], injection }
}

/// Creates a kind that is injected in every armed situation.
pub(super) const fn kind(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &Situation::ARMED, injection }
}

/// Creates a kind that is injected while armed with the deadman open.
pub(super) const fn armed(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &[Situation::Armed], injection }
}

/// Creates a kind that is injected while the arm moves itself.
pub(super) const fn parking(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &[Situation::Parking], injection }
}

/// Creates a kind that is injected while the grip commands.
pub(super) const fn engaged(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &Situation::ENGAGED, injection }
}

/// Creates a kind that is injected while the object presses against the wall.
pub(super) const fn in_contact(
    hazard: u8,
    name: &'static str,
    causes: &'static [CauseKind],
    injection: MakeInjection,
) -> CaseKind {
    CaseKind { name, hazard, causes, situations: &[Situation::Contact], injection }
}
