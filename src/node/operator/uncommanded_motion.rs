//! Uncommanded motion while gravity compensation ramps up: a wrong mass, a wrong sign, a wrong zero.
//!
//! Gravity compensation that is right drives nothing: it takes the weight off the hand or the stop that
//! carries it, or slows an arm that falls. So it is only watched for joints that move the way they are
//! pushed, and only while the share of gravity grows and nobody holds the deadman; later the operator may
//! move the arm as they like. A soft hand is lifted a little as the weight leaves it, and swings: one way is
//! a motion only when it goes on. Who lifts the arm within this second looks the same, and has to arm again.

use crate::cause::Cause;
use controller::JointVector;

/// Minimum speed of a joint that counts as motion, in rad/s (m/s).
const MIN_SPEED: f64 = 0.1;

/// Maximum motion one way, in rad (m): a relaxed hand rises by 0.65 rad as the weight leaves it. An arm faster than
/// any hand is stopped before, by the speed of the grip.
const MAX_MOTION: f64 = 0.9;

/// How far each joint has been driven without slowing down or turning back, in rad (m).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UncommandedMotion {
    driven: [f64; 6],
}

impl UncommandedMotion {
    /// Takes how far the joints came in the last `dt` s, in rad (m), and the torques that acted meanwhile.
    /// `is_watched` while the weight is taken up and nobody holds the deadman.
    pub(super) fn watch(
        &mut self,
        dt: f64,
        is_watched: bool,
        tau: &JointVector,
        came: &JointVector,
    ) -> Option<Cause> {
        let joints = self.driven.iter_mut().zip(tau.iter().zip(came.iter()));
        for (driven, (tau, came)) in joints {
            let is_driven = is_watched && came.abs() > MIN_SPEED * dt && tau * came > 0.0;
            *driven = if is_driven { *driven + came.abs() } else { 0.0 };
        }
        self.driven.iter().any(|driven| *driven > MAX_MOTION).then_some(Cause::UncommandedMotion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(second: f64) -> JointVector {
        JointVector::from([0.0, second, 0.0, 0.0, 0.0, 0.0])
    }

    /// After how many ms a steady motion trips, if it does within a second.
    fn trips(is_watched: bool, tau: f64, qd: f64) -> Option<u32> {
        let mut watch = UncommandedMotion::default();
        let came = joints(qd * 1e-3);
        (1..1_000).find(|_| watch.watch(1e-3, is_watched, &joints(tau), &came).is_some())
    }

    #[test]
    fn hazard_41_an_arm_that_is_driven_while_it_is_taken_up_trips() {
        assert_eq!((trips(true, 2.0, 3.01), trips(true, -2.0, -1.01)), (Some(300), Some(892)));
        assert_eq!(trips(true, 2.0, 0.09), None, "too slow");
        // As fast as what trips after 300 ms above, but for one thing.
        assert_eq!(trips(true, 2.0, -3.01), None, "it falls and is caught");
        assert_eq!(trips(true, 0.0, 3.01), None, "not by the node");
        assert_eq!(trips(false, 2.0, 3.01), None, "it is moved by hand");
        assert_eq!(trips(true, f64::NAN, f64::NAN), None);
    }

    #[test]
    fn a_hand_that_swings_under_the_weight_is_not_driven_away() {
        let mut watch = UncommandedMotion::default();
        for ms in 0..1_000_u32 {
            // 5 Hz, 40 mrad to either side.
            let came = 0.04 * 31.4 * 1e-3 * (31.4e-3 * f64::from(ms)).cos();
            assert_eq!(watch.watch(1e-3, true, &joints(1.0), &joints(came)), None);
        }
    }
}
