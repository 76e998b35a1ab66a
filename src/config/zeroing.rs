//! Zero of each joint by the rest posture: the shift that makes its counts those of the arm at rest.
//!
//! A zero belongs to an actuator, a posture to the joints. Actuators that `[coupling]` ties are set together.

use crate::parameters::Parameters;
use crate::rest::Rest;
use crate::zero::{Zero, ZeroSource};
use controller::JointVector;
use controller::calibration::Calibration;
use units::drive::Counts;
use units::numbering::Joint;

/// Rest posture of an arm, and the counts of each drive in it.
#[derive(Clone, Debug)]
pub struct Zeroing {
    zeros: [Zero; 6],
    rests: [Option<Rest>; 6],
    second_rests: [Option<Rest>; 6],
    calibration: Calibration<6>,
    /// Counts at rest; a joint without rest position counts as at zero.
    rest_counts: [Counts; 6],
    /// Joints that the coupling ties to each joint, itself included.
    groups: [[bool; 6]; 6],
}

impl Zeroing {
    /// Returns the rest posture of a configuration, and its counts.
    pub fn new(config: &Parameters) -> Self {
        let rests = config.joints.each_ref().map(|joint| joint.rest);
        let q = rests.map(|rest| rest.map_or(0.0, |rest| rest.position()));
        let calibration = config.controller.calibration;
        Self {
            zeros: config.joints.each_ref().map(|joint| joint.zero),
            rests,
            second_rests: config.joints.each_ref().map(|joint| joint.second_rest),
            rest_counts: calibration.counts(&JointVector::from(q)),
            groups: Joint::ALL.map(|joint| tied(&calibration, joint)),
            calibration,
        }
    }

    /// Returns where the zero of a joint comes from.
    pub fn zero(&self, joint: Joint) -> &Zero {
        joint.entry(&self.zeros)
    }

    /// Returns the rest position of a joint.
    pub fn rest(&self, joint: Joint) -> Option<Rest> {
        *joint.entry(&self.rests)
    }

    /// Returns the second rest position of a joint.
    pub fn second_rest(&self, joint: Joint) -> Option<Rest> {
        *joint.entry(&self.second_rests)
    }

    /// Returns the joints that the coupling ties to `joint`, itself included.
    pub fn group(&self, joint: Joint) -> [bool; 6] {
        *joint.entry(&self.groups)
    }

    /// Returns the counts of a drive with its joint at rest.
    pub fn rest_counts(&self, joint: Joint) -> Counts {
        *joint.entry(&self.rest_counts)
    }

    /// Returns the number to add to 6064h of a drive that reads `counts` with its joint at rest; wraps.
    pub fn shift(&self, joint: Joint, counts: Counts) -> i32 {
        let off = self.rest_counts(joint).0.wrapping_sub(counts.0);
        match self.zero(joint).source {
            ZeroSource::Absolute | ZeroSource::Homing(_) => 0,
            ZeroSource::Rest => off,
            ZeroSource::SingleTurn { counts: revolution } => nearest_multiple(off, revolution),
        }
    }

    /// Returns the position of each joint if its zero were set now, in rad or m; `None` for those that are absolute.
    pub fn if_zeroed(&self, counts: &[Counts; 6]) -> [Option<f64>; 6] {
        let set = Joint::ALL.map(|joint| {
            let counts = *joint.entry(counts);
            // Homing makes the drive count from there.
            if matches!(self.zero(joint).source, ZeroSource::Homing(_)) {
                self.rest_counts(joint)
            } else {
                Counts(counts.0.wrapping_add(self.shift(joint, counts)))
            }
        });
        let q: [f64; 6] = self.positions(&set).into();
        Joint::ALL.map(|joint| {
            let is_set = !self.zero(joint).source.is_absolute();
            is_set.then_some(*joint.entry(&q))
        })
    }

    /// Converts counts, shifted to the zero, to joint positions in rad or m.
    pub fn positions(&self, counts: &[Counts; 6]) -> JointVector {
        self.calibration.positions(counts)
    }
}

/// Returns the multiple of `revolution` nearest to `counts`, rounded.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "within half a revolution of an i32; a float that is out of range saturates"
)]
fn nearest_multiple(counts: i32, revolution: f64) -> i32 {
    ((f64::from(counts) / revolution).round() * revolution).round() as i32
}

/// Returns the joints that share actuators with `joint`, directly or through others.
fn tied(calibration: &Calibration<6>, joint: Joint) -> [bool; 6] {
    let matrix = calibration.coupling().matrix();
    let are_tied = |a: usize, b: usize| {
        let at =
            |row, column| matrix.get((row, column)).is_some_and(|entry: &f64| entry.abs() > 0.0);
        at(a, b) || at(b, a)
    };
    let mut group = Joint::ALL.map(|other| other == joint);
    // Each pass adds the neighbours of those found; a chain of six has five links.
    for _ in 1..group.len() {
        group = Joint::ALL.map(|other| {
            *other.entry(&group)
                || Joint::each(group)
                    .any(|(one, is_in)| is_in && are_tied(one.index(), other.index()))
        });
    }
    group
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_revolution_is_selected() {
        for (off, expected) in [(0, 0), (8_191, 0), (8_193, 16_384), (-30_000, -32_768)] {
            assert_eq!(nearest_multiple(off, 16_384.0), expected, "{off}");
        }
        // A third of a revolution: a resolver with three pole pairs.
        assert_eq!(nearest_multiple(11_000, 16_384.0 / 3.0), 10_923);
    }
}
