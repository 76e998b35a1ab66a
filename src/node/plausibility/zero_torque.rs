//! Torque actual values (6077h) at zero target torque.
//!
//! A drive that has lost its RPDOs holds its last target, and its torque actual value shows it. A value counts if the targets
//! of the last five cycles were zero: these are the targets that the drive may have applied.

use crate::plausibility::sample_set::SampleSet;
use config::TAKEN_CYCLES;
use units::drive::PerMille;
use units::numbering::Joint;

/// Newest torque actual values at zero target torque.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ZeroTorque {
    /// Consecutive cycles in which all targets were zero.
    zero_cycles: u32,
    shown: [Option<PerMille>; 6],
}

impl ZeroTorque {
    /// Takes the target torques sent in a cycle, in ‰ of rated torque.
    pub(super) fn on_sent(&mut self, targets: &[i16; 6]) {
        if *targets == [0; 6] {
            self.zero_cycles = self.zero_cycles.saturating_add(1);
        } else {
            *self = Self::default();
        }
    }

    /// Takes the actual torques received in this cycle.
    pub(super) fn on_samples(&mut self, sampled: &SampleSet<'_>) {
        let readings = sampled.latest.iter().zip(sampled.torques);
        let acts = self.zero_cycles >= TAKEN_CYCLES;
        for (joint, (sample, _)) in
            Joint::each(readings).filter(|(_, (_, is_read))| acts && *is_read)
        {
            *joint.entry_mut(&mut self.shown) = Some(sample.torque);
        }
    }

    /// Returns the newest value of each joint since zero target torque acts.
    pub(super) const fn shown(&self) -> [Option<PerMille>; 6] {
        self.shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::pdo::DriveSample;
    use units::time::Instant;

    const ELBOW: Joint = Joint::of::<3>();

    /// Receives this torque of the elbow, then sends its next target.
    fn cycle(zero: &mut ZeroTorque, torque: i16, target: i16) -> Option<i16> {
        let mut latest = [DriveSample::default(); 6];
        ELBOW.entry_mut(&mut latest).torque = PerMille(torque);
        let torques = Joint::ALL.map(|joint| joint == ELBOW);
        let (at, fresh, demands) = (Instant::ZERO, torques, [None; 6]);
        zero.on_samples(&SampleSet { at, latest: &latest, fresh, torques, demands });
        zero.on_sent(&[0, 0, target, 0, 0, 0]);
        ELBOW.entry(&zero.shown()).map(|PerMille(torque)| torque)
    }

    #[test]
    fn torque_counts_once_five_targets_were_zero() {
        let mut zero = ZeroTorque::default();
        let none = [cycle(&mut zero, 7, 100), cycle(&mut zero, 8, 0)];
        assert_eq!(none, [None; 2], "before a zero target acts");
        for torque in [0, -3, -90, -180] {
            assert_eq!(cycle(&mut zero, torque, 0), None, "an earlier target may act");
        }
        assert_eq!([cycle(&mut zero, -225, 0), cycle(&mut zero, 4, 0)], [Some(-225), Some(4)]);
        assert_eq!(cycle(&mut zero, 5, 1), None, "a target is sent");
    }
}
