//! Time for which each joint has been at standstill.

use canopen::pdo::DriveSample;
use config::Config;
use controller::arm::JointKind;
use std::time::Duration;
use units::drive::Counts;
use units::numbering::Joint;
use units::time::Instant;

/// Motion of a revolute joint that ends its standstill, in rad: 0.1°.
const ROTATION: f64 = 0.1_f64.to_radians();

/// Motion of a prismatic joint that ends its standstill, in m.
const TRANSLATION: f64 = 2e-4;

/// Noise of an encoder at standstill, in counts.
const NOISE: u32 = 2;

/// Standstill of all joints.
#[derive(Clone, Debug)]
pub(super) struct Standstill {
    /// Motion that ends a standstill, in counts.
    bands: [u32; 6],
    /// Counts and time at its start; `None` before the first sample.
    starts: [Option<(Counts, Instant)>; 6],
}

impl Standstill {
    /// Returns standstills before the first sample.
    pub(super) fn new(config: &Config) -> Self {
        let band = |joint: Joint| {
            let joint = joint.entry(&config.joints);
            let motion = match joint.plant.link.kind {
                JointKind::Revolute => ROTATION,
                JointKind::Prismatic => TRANSLATION,
            };
            joint.calibration.span(motion).saturating_add(NOISE)
        };
        Self { bands: Joint::ALL.map(band), starts: [None; 6] }
    }

    /// Starts again, before a boot.
    pub(super) const fn restart(&mut self) {
        self.starts = [None; 6];
    }

    /// Takes the samples of a cycle. A joint whose sample is missing is not at standstill.
    pub(super) fn on_samples(
        &mut self,
        now: Instant,
        samples: &[DriveSample; 6],
        fresh: &[bool; 6],
    ) {
        for (joint, start) in Joint::each(&mut self.starts) {
            let position = joint.entry(samples).position;
            let band = *joint.entry(&self.bands);
            let is_still = |(from, _): &(Counts, Instant)| {
                position.0.wrapping_sub(from.0).unsigned_abs() <= band
            };
            *start = if *joint.entry(fresh) {
                start.filter(is_still).or(Some((position, now)))
            } else {
                None
            };
        }
    }

    /// Returns the time for which a joint has been at standstill.
    pub(super) fn time(&self, joint: Joint, now: Instant) -> Duration {
        joint.entry(&self.starts).map_or(Duration::ZERO, |(_, since)| now.since(since))
    }
}
