//! Stop on a ramp (605Ah to 605Eh), with a timeout of [`MAX_STOP_TIME`].

use crate::motion::{Feedback, Motion, Ramp, TorqueDemand};
use canopen_device::dictionary::Dictionary;

/// Maximum duration of a stop, in s; afterwards the motor is released.
pub(super) const MAX_STOP_TIME: f64 = 4.0;

/// Ramp of a stop in progress, and its time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    ramp: Ramp,
    /// Time since its start, in s.
    elapsed: f64,
}

impl Stop {
    /// Starts a stop.
    pub(super) const fn new(ramp: Ramp) -> Self {
        Self { ramp, elapsed: 0.0 }
    }

    /// Returns the same stop on another ramp.
    pub(super) const fn on(self, ramp: Ramp) -> Self {
        Self { ramp, ..self }
    }

    /// Returns whether [`MAX_STOP_TIME`] has passed.
    pub(super) const fn has_timed_out(&self) -> bool {
        self.elapsed >= MAX_STOP_TIME
    }

    /// Advances by `dt` s; `None` once the stop is over.
    pub(super) fn step(
        &mut self,
        dt: f64,
        motion: &mut Motion,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Option<TorqueDemand> {
        self.elapsed += dt;
        if self.has_timed_out() { None } else { motion.stop(dt, self.ramp, feedback, dictionary) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::SERVO_PERIOD;
    use canopen::NodeId;
    use canopen::eds::Eds;
    use canopen::object::Object;

    const PROFILE_TORQUE: i8 = 4;

    /// Returns the number of periods in which `slope` ‰/s lowers a torque of 3,000 ‰.
    fn periods(slope: u32) -> usize {
        let eds = Eds::parse(include_bytes!("../../../../eds/frhc_drive.eds")).unwrap();
        let mut dictionary = Dictionary::new(&eds, NodeId::new(1).unwrap());
        dictionary.set(Object::TARGET_TORQUE, &3_000_i16.to_le_bytes());
        let (mut motion, feedback) = (Motion::default(), Feedback::default());
        motion.begin(PROFILE_TORQUE, &feedback, &dictionary);
        motion.step(1.0, &feedback, &mut dictionary);
        dictionary.set(Object::TORQUE_SLOPE, &slope.to_le_bytes());
        let mut stop = Stop::new(Ramp::SlowDown);
        let pushes = || stop.step(SERVO_PERIOD, &mut motion, &feedback, &mut dictionary).is_some();
        std::iter::repeat_with(pushes).take_while(|pushes| *pushes).count()
    }

    #[test]
    fn stop_takes_its_ramp_time_up_to_the_timeout() {
        for (slope, millis) in [(30_000, 100), (1_000, 3_000), (100, 4_000), (1, 4_000)] {
            let taken = periods(slope);
            assert!(taken.abs_diff(millis) <= 2, "{slope} ‰/s: {taken} ms");
        }
    }
}
