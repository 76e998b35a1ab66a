//! Reaction of each mode to each kind of cause, from its [row](crate::cause).
//!
//! A kind or a mode without an entry does not compile. `frhc explain faults` prints the table.
//! [`safety`](crate::safety) executes it, and nothing else decides on a stop.

use crate::cause::CauseKind;
use crate::reaction::Reaction;
use crate::record::Mode;

impl Reaction {
    /// Returns the mode it leads to, or `None` if the mode stays.
    pub const fn mode(self) -> Option<Mode> {
        match self {
            Self::NoStop => None,
            Self::ReflectionOff => Some(Mode::ReflectionOff),
            Self::ZeroTorque => Some(Mode::ZeroTorque),
            Self::DrivesOff => Some(Mode::DrivesOff),
        }
    }
}

/// Returns the reaction of `mode` to a cause of this kind; never one milder than the mode.
pub const fn reaction(kind: CauseKind, mode: Mode) -> Reaction {
    let row = kind.row();
    match mode {
        Mode::Boot | Mode::Ready => row.unarmed,
        Mode::Armed | Mode::Engaged => row.armed,
        // Nothing is commanded and nothing felt: the commanded side cannot matter.
        Mode::Measuring if kind.is_of_commanded_side() => Reaction::NoStop,
        Mode::Measuring => row.armed,
        Mode::ReflectionOff => stricter(row.armed, Reaction::ReflectionOff),
        Mode::ZeroTorque => stricter(row.armed, Reaction::ZeroTorque),
        Mode::DrivesOff => Reaction::DrivesOff,
    }
}

/// Returns the stricter of two reactions. `Ord::max` is not const.
const fn stricter(one: Reaction, other: Reaction) -> Reaction {
    match (one, other) {
        (Reaction::DrivesOff, _) | (_, Reaction::DrivesOff) => Reaction::DrivesOff,
        (Reaction::ZeroTorque, _) | (_, Reaction::ZeroTorque) => Reaction::ZeroTorque,
        (Reaction::ReflectionOff, _) | (_, Reaction::ReflectionOff) => Reaction::ReflectionOff,
        (Reaction::NoStop, Reaction::NoStop) => Reaction::NoStop,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_never_become_milder_nor_reflection_off_if_unarmed() {
        for kind in CauseKind::ALL {
            assert_ne!(kind.row().unarmed, Reaction::ReflectionOff, "{kind:?}");
            for mode in [Mode::ReflectionOff, Mode::ZeroTorque, Mode::DrivesOff] {
                let after = reaction(kind, mode).mode().unwrap();
                let rank = |mode| Mode::ALL.iter().position(|one| *one == mode);
                assert!(rank(after) >= rank(mode), "{kind:?} in {mode}: {after}");
            }
        }
    }

    #[test]
    fn armed_reactions_are_at_least_as_strict_as_unarmed_ones() {
        for kind in CauseKind::ALL {
            let row = kind.row();
            assert!(row.unarmed <= row.armed, "{kind:?}");
            assert!(row.armed > Reaction::NoStop && !row.hazards.is_empty(), "{kind:?}");
        }
    }
}
