//! A stop that takes its time (605Ah to 605Eh), and no longer than [`LONGEST`], however it is meant.

use crate::motion::Asked;
use crate::motion::Feedback;
use crate::motion::Motion;
use crate::motion::Ramp;
use canopen::dictionary::Dictionary;

/// A motor that does not stand still after so many seconds is let go.
pub(super) const LONGEST: f64 = 4.0;

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

    /// The same on another ramp, if it is another one.
    pub(super) const fn on(self, ramp: Ramp) -> Self {
        Self { ramp, ..self }
    }

    /// Whether the motor is let go.
    pub(super) const fn is_given_up(&self) -> bool {
        self.elapsed >= LONGEST
    }

    /// `dt` s have passed; `None` once it is over.
    pub(super) fn step(
        &mut self,
        dt: f64,
        motion: &mut Motion,
        feedback: &Feedback,
        dictionary: &mut Dictionary,
    ) -> Option<Asked> {
        self.elapsed += dt;
        if self.is_given_up() { None } else { motion.stop(dt, self.ramp, feedback, dictionary) }
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

    /// For how many periods a torque of 3,000 ‰ is lowered by `slope` ‰/s.
    fn periods(slope: u32) -> usize {
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
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
    fn it_takes_as_long_as_its_ramp_but_never_longer_than_the_longest() {
        for (slope, millis) in [(30_000, 100), (1_000, 3_000), (100, 4_000), (1, 4_000)] {
            let taken = periods(slope);
            assert!(taken.abs_diff(millis) <= 2, "{slope} ‰/s: {taken} ms");
        }
    }
}
