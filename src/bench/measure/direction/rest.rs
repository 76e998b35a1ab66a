//! An arm at rest: no joint has left its place for half a second.

use controller::JointVector;
use controller::arm::JointKind;

/// Motion within which a joint that a hand may touch is at rest, in rad and m.
const STILL: [f64; 2] = [0.5_f64.to_radians(), 2e-3];

/// Time at rest, in s.
const TIME: f64 = 0.5;

/// Places and time of the rest so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    still: JointVector,
    since: Option<(f64, JointVector)>,
}

impl Rest {
    /// Begins in motion.
    pub(super) fn new(kinds: &[JointKind; 6]) -> Self {
        Self { still: per_kind(kinds, STILL), since: None }
    }

    /// Forgets the rest so far.
    pub(super) const fn restart(&mut self) {
        self.since = None;
    }

    /// Takes positions in rad or m, at a time in s. Returns whether the arm is at rest.
    pub(super) fn take(&mut self, at: f64, q: &JointVector) -> bool {
        let stays = self.since.is_some_and(|(_, from)| {
            (q - from).abs().iter().zip(self.still.iter()).all(|(moved, still)| moved <= still)
        });
        if !stays {
            self.since = Some((at, *q));
        }
        self.since.is_some_and(|(since, _)| at - since >= TIME)
    }
}

/// Returns the first value for each revolute joint, the second for each prismatic one.
pub(super) fn per_kind(kinds: &[JointKind; 6], values: [f64; 2]) -> JointVector {
    JointVector::from(kinds.map(|kind| kind.pick(values)))
}
