//! A stop that takes its time (605Ah to 605Eh): along a ramp of the velocity, or of the torque where the
//! torque is what is commanded.
//!
//! CiA 402-2 has the slow-down ramp of the torque modes in 6087h. Neither a quick stop nor a current limit
//! means anything to them: both take the torque off at once, since to brake would be to push. However a
//! stop is meant, it pushes no longer than [`LONGEST`].

use crate::canopen::dictionary::Dictionary;
use crate::canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use crate::canopen::object::Object;
use crate::sim::motion::Asked;
use crate::sim::motion::Feedback;
use crate::sim::motion::Motion;
use crate::sim::motion::Ramp;

/// A motor that does not stand still after so many seconds is let go.
pub(super) const LONGEST: f64 = 2.0;

/// One stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    ramp: Ramp,
    /// For how many s it has been going on.
    elapsed: f64,
}

impl Stop {
    /// One that begins now.
    pub(super) const fn new(ramp: Ramp) -> Self {
        Self { ramp, elapsed: 0.0 }
    }

    /// How it is made.
    pub(super) const fn ramp(&self) -> Ramp {
        self.ramp
    }

    /// Ready to hold a motor that stands still, should it be moved; one that never stood still is let go
    /// for good.
    pub(super) const fn again(self) -> Self {
        if self.is_given_up() { self } else { Self::new(Ramp::QuickStop) }
    }

    const fn is_given_up(&self) -> bool {
        self.elapsed >= LONGEST
    }

    /// `dt` s have passed, in which `last` was asked for; `None` once it is over.
    pub(super) fn step(
        &mut self,
        dt: f64,
        mode: i8,
        last: &Asked,
        motion: &mut Motion,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Option<Asked> {
        self.elapsed += dt;
        if self.is_given_up() {
            None
        } else if !is_held(mode) {
            self.release(dt, last.per_mille, dictionary)
        } else if dt > 0.0 {
            motion.stop(dt, self.ramp, feedback, dictionary)
        } else {
            Some(*last)
        }
    }

    /// Takes the torque off.
    fn release(&self, dt: f64, per_mille: f64, dictionary: &Dictionary) -> Option<Asked> {
        let slope = dictionary.unsigned(Object::TORQUE_SLOPE);
        match self.ramp {
            Ramp::SlowDown if slope > 0 => {
                let size = per_mille.abs() - f64::from(slope) * dt;
                let asked = Asked { per_mille: size * per_mille.signum(), ..Asked::default() };
                (size > 0.0).then_some(asked)
            }
            Ramp::SlowDown | Ramp::QuickStop | Ramp::CurrentLimit => None,
        }
    }
}

/// Whether a motor is held at a standstill in `mode`: not where torque is what is commanded.
pub(super) const fn is_held(mode: i8) -> bool {
    !matches!(mode, NO_MODE | PROFILE_TORQUE | CYCLIC_SYNCHRONOUS_TORQUE)
}

/// 6060h: none is chosen.
pub(super) const NO_MODE: i8 = 0;
/// 6060h: 6071h, target torque, is approached along 6087h.
const PROFILE_TORQUE: i8 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::NodeId;
    use crate::canopen::eds::Eds;
    use crate::sim::motion::SERVO_PERIOD;

    fn dictionary(slope: u32) -> Dictionary {
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
        let mut dictionary = Dictionary::new(&eds, NodeId::new(1).unwrap());
        dictionary.set(Object::TORQUE_SLOPE, &slope.to_le_bytes());
        dictionary
    }

    /// The torque, period by period, from `per_mille` until the stop is over.
    fn course(ramp: Ramp, slope: u32, per_mille: f64) -> Vec<f64> {
        let (mut stop, mut dictionary) = (Stop::new(ramp), dictionary(slope));
        let mut asked = Asked { per_mille, ..Asked::default() };
        let mut course = Vec::new();
        let (mut motion, feedback) = (Motion::default(), Feedback::default());
        while let Some(next) =
            stop.step(SERVO_PERIOD, 10, &asked, &mut motion, &feedback, &mut dictionary)
        {
            asked = next;
            course.push(asked.per_mille);
        }
        course
    }

    #[test]
    fn a_torque_is_slowed_down_along_its_slope() {
        let course = course(Ramp::SlowDown, 10_000, -100.0);
        let whole: Vec<_> = course.iter().map(|per_mille| per_mille.round()).collect();
        assert_eq!(whole[..3], [-90.0, -80.0, -70.0]);
        assert!((9..=10).contains(&course.len()), "{} ms", course.len());
    }

    #[test]
    fn a_quick_stop_takes_the_torque_off_at_once() {
        for ramp in [Ramp::QuickStop, Ramp::CurrentLimit] {
            assert_eq!(course(ramp, 1, 500.0).len(), 0);
        }
    }

    #[test]
    fn the_slowest_slope_ends_all_the_same() {
        let seconds = course(Ramp::SlowDown, 1, 3_000.0).len() as f64 * SERVO_PERIOD;
        assert!((seconds - LONGEST).abs() < 0.01, "{seconds} s");
    }
}
