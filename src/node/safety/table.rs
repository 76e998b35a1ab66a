//! What each kind of cause does in each mode, as its [row](crate::cause) says.
//!
//! A kind or a mode without an entry does not compile. `frhc explain faults` prints the table, and
//! [`safety`](crate::safety) does what it says; nothing else decides what a cause leads to.

use crate::cause::Kind;
use crate::reaction::Reaction;
use crate::record::Mode;

impl Reaction {
    /// The mode it leads to, if to another.
    pub const fn mode(self) -> Option<Mode> {
        match self {
            Self::None => None,
            Self::ReflectionOff => Some(Mode::ReflectionOff),
            Self::ZeroTorque => Some(Mode::ZeroTorque),
            Self::DrivesOff => Some(Mode::DrivesOff),
        }
    }
}

/// What a cause of this kind leads to in a mode; never to a milder one than it is in.
pub const fn reaction(kind: Kind, mode: Mode) -> Reaction {
    let row = kind.row();
    match mode {
        Mode::Boot | Mode::Ready => row.unarmed,
        Mode::Armed | Mode::Engaged => row.armed,
        Mode::ReflectionOff => worse(row.armed, Reaction::ReflectionOff),
        Mode::ZeroTorque => worse(row.armed, Reaction::ZeroTorque),
        Mode::DrivesOff => Reaction::DrivesOff,
    }
}

const fn worse(one: Reaction, other: Reaction) -> Reaction {
    match (one, other) {
        (Reaction::DrivesOff, _) | (_, Reaction::DrivesOff) => Reaction::DrivesOff,
        (Reaction::ZeroTorque, _) | (_, Reaction::ZeroTorque) => Reaction::ZeroTorque,
        (Reaction::ReflectionOff, _) | (_, Reaction::ReflectionOff) => Reaction::ReflectionOff,
        (Reaction::None, Reaction::None) => Reaction::None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latch_never_becomes_milder_and_where_nothing_is_carried_nothing_is_carried_on() {
        for kind in Kind::ALL {
            assert_ne!(kind.row().unarmed, Reaction::ReflectionOff, "{kind:?}");
            for mode in [Mode::ReflectionOff, Mode::ZeroTorque, Mode::DrivesOff] {
                let after = reaction(kind, mode).mode().unwrap();
                let rank = |mode| Mode::ALL.iter().position(|one| *one == mode);
                assert!(rank(after) >= rank(mode), "{kind:?} in {mode}: {after}");
            }
        }
    }

    #[test]
    fn what_acts_where_nothing_flows_acts_where_something_does() {
        for kind in Kind::ALL {
            let row = kind.row();
            assert!(row.unarmed <= row.armed, "{kind:?}");
            assert!(row.armed > Reaction::None && !row.hazards.is_empty(), "{kind:?}");
        }
    }
}
