//! Uncommanded motion. Either gravity compensation with a wrong mass, sign or zero drives the arm, or a joint that its
//! friction compensation drove continues to move after the compensation was withdrawn.
//!
//! Correct gravity compensation drives no joint. It relieves the hand or the stop that carries the weight, or brakes a
//! falling arm. Motion in the direction of the torque is therefore checked while gravity compensation ramps up and the
//! deadman is released. A relaxed hand rises a little as the weight leaves it, and swings, so motion counts until it
//! reverses. An operator who lifts the arm in this second causes the same stop, and must arm again.

use crate::cause::Cause;
use controller::JointVector;
use units::numbering::Joint;

/// Minimum speed of a joint that counts as motion, in rad/s (m/s).
const MIN_SPEED: f64 = 0.1;

/// Maximum motion in one direction, in rad (m). A relaxed hand rises by 0.65 rad as the weight leaves it. The speed limit
/// of the grip stops faster arms earlier.
const MAX_MOTION: f64 = 0.9;

/// Maximum motion of a joint after its friction compensation was withdrawn, in rad (m). Beyond it something else drives the
/// joint.
const MAX_MOTION_WITHDRAWN: f64 = 0.25;

/// Monitor of a joint that its friction compensation drove.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DrivenOn {
    /// Motion since the withdrawal, in rad (m); `None` before, and once the joint has stopped or turned.
    travel: Option<f64>,
    was_withdrawn: bool,
}

impl DrivenOn {
    /// Checks the motion `dq` of the joints in the last `dt` s, in rad (m). `self_driven` is the joint whose compensation is
    /// withdrawn, and `None` while not engaged.
    pub(super) fn check(
        &mut self,
        dt: f64,
        self_driven: Option<Joint>,
        dq: &JointVector,
        fresh: &[bool; 6],
    ) -> Option<Cause> {
        let Some((dq, is_fresh)) = self_driven.and_then(|joint| {
            let place = joint.index();
            Some((*dq.get(place)?, *fresh.get(place)?))
        }) else {
            *self = Self::default();
            return None;
        };
        if !std::mem::replace(&mut self.was_withdrawn, true) {
            self.travel = Some(0.0);
        }
        if is_fresh {
            let goes_on = |travel: &f64| dq.abs() > MIN_SPEED * dt && travel * dq >= 0.0;
            self.travel = self.travel.filter(goes_on).map(|travel| travel + dq);
        }
        let is_beyond = self.travel.is_some_and(|travel| travel.abs() > MAX_MOTION_WITHDRAWN);
        is_beyond.then_some(Cause::UncommandedMotion)
    }
}

/// Monitor of all joints.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UncommandedMotion {
    /// Driven motion of each joint since it last stopped or reversed, in rad (m).
    driven: [f64; 6],
}

impl UncommandedMotion {
    /// Checks the motion `dq` of the joints in the last `dt` s, in rad (m), against the torques that acted meanwhile.
    /// `is_active` while gravity compensation ramps up and the deadman is released. A joint that is not `fresh` has no
    /// sample of this cycle; its next motion is that of both.
    pub(super) fn check(
        &mut self,
        dt: f64,
        is_active: bool,
        tau: &JointVector,
        dq: &JointVector,
        fresh: &[bool; 6],
    ) -> Option<Cause> {
        let joints = self.driven.iter_mut().zip(tau.iter().zip(dq.iter())).zip(fresh);
        for ((driven, (tau, dq)), is_fresh) in joints {
            let is_driven = dq.abs() > MIN_SPEED * dt && tau * dq > 0.0;
            *driven = match (is_active, is_fresh) {
                (true, false) => *driven,
                (true, true) if is_driven => *driven + dq.abs(),
                _ => 0.0,
            };
        }
        self.driven.iter().any(|driven| *driven > MAX_MOTION).then_some(Cause::UncommandedMotion)
    }
}

/// Returns the cause for a joint beyond its limit while gravity compensation ramps up and the deadman is released. Either
/// its position is wrong, or gravity compensation drives it, which an end of reflection would not stop.
pub(super) const fn of_limit(found: Option<Cause>, is_active: bool) -> Option<Cause> {
    match found {
        Some(Cause::BeyondLimit { .. }) if is_active => Some(Cause::UncommandedMotion),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint_reading::JointReading;
    use controller::arm::JointKind;
    use units::math;

    fn joints(second: f64) -> JointVector {
        JointVector::from([0.0, second, 0.0, 0.0, 0.0, 0.0])
    }

    /// Returns the time in ms after which a steady motion trips, if it does within a second.
    fn trips(is_active: bool, tau: f64, qd: f64) -> Option<u32> {
        let mut monitor = UncommandedMotion::default();
        let dq = joints(qd * 1e-3);
        (1..1_000).find(|_| monitor.check(1e-3, is_active, &joints(tau), &dq, &[true; 6]).is_some())
    }

    #[test]
    fn hazard_41_joint_driven_while_gravity_ramps_up_trips() {
        assert_eq!((trips(true, 2.0, 3.01), trips(true, -2.0, -1.01)), (Some(300), Some(892)));
        assert_eq!(trips(true, 2.0, 0.09), None, "too slow");
        // Each differs in one value from the motion above that trips after 300 ms.
        assert_eq!(trips(true, 2.0, -3.01), None, "falls and is braked");
        assert_eq!(trips(true, 0.0, 3.01), None, "without torque");
        assert_eq!(trips(false, 2.0, 3.01), None, "after the ramp");
        assert_eq!(trips(true, f64::NAN, f64::NAN), None);
    }

    #[test]
    fn hazard_41_lost_samples_hide_no_driven_joint() {
        let mut monitor = UncommandedMotion::default();
        let mut lost = 0.0;
        let tripped = (1..1_000_u32).find(|ms| {
            // Every tenth sample is lost; the next one shows the motion of both cycles.
            let is_fresh = ms % 10 != 0;
            let dq = if is_fresh { 3.01e-3 + lost } else { 0.0 };
            lost = if is_fresh { 0.0 } else { 3.01e-3 };
            let fresh = [true, is_fresh, true, true, true, true];
            monitor.check(1e-3, true, &joints(2.0), &joints(dq), &fresh).is_some()
        });
        assert_eq!(tripped, Some(301), "one cycle later at most");
    }

    #[test]
    fn hazard_41_joint_beyond_its_limit_in_the_ramp_ends_torque() {
        let at = JointReading::new(2.0, JointKind::Revolute);
        let joint = Joint::of::<3>();
        let beyond = Some(Cause::BeyondLimit { joint, position: at, limit: at });
        assert_eq!(of_limit(beyond, true), Some(Cause::UncommandedMotion));
        assert_eq!(of_limit(beyond, false), None, "the row of the cause applies");
        assert_eq!(of_limit(Some(Cause::Late), true), None);
        assert_eq!(of_limit(None, true), None);
    }

    /// Returns the time in ms of the cause, within a second, for the second joint after its compensation was withdrawn. `qd`
    /// is its rate in rad/s at a time in s.
    fn trips_withdrawn(qd: impl Fn(f64) -> f64) -> Option<u32> {
        let mut monitor = DrivenOn::default();
        let second = Some(Joint::of::<2>());
        (0..1_000_u32).find(|ms| {
            let dq = joints(qd(f64::from(*ms) * 1e-3) * 1e-3);
            monitor.check(1e-3, second, &dq, &[true; 6]).is_some()
        })
    }

    #[test]
    fn hazard_41_joint_that_moves_on_without_compensation_trips() {
        assert_eq!(
            (trips_withdrawn(|_| 1.01), trips_withdrawn(|_| -0.501)),
            (Some(247), Some(499))
        );
        assert_eq!(trips_withdrawn(|t| 1.0 - 4.0 * t), None, "comes to rest within 0.125 rad");
        assert_eq!(trips_withdrawn(|t| if t < 0.2 { 1.0 } else { -2.0 }), None, "a hand");
        assert_eq!(trips_withdrawn(|t| if t < 0.1 { 0.0 } else { 2.0 }), None, "it was at rest");
        assert_eq!(trips_withdrawn(|_| f64::NAN), None);
    }

    #[test]
    fn hazard_41_each_withdrawal_is_checked_anew() {
        let mut monitor = DrivenOn::default();
        let [moves, rests] = [2e-3, 0.0].map(joints);
        let second = Some(Joint::of::<2>());
        let mut check = |self_driven, dq| monitor.check(1e-3, self_driven, dq, &[true; 6]);
        assert!((0..1_000).all(|_| check(None, &moves).is_none()), "not withdrawn");
        assert_eq!(check(second, &rests), None);
        assert!((0..1_000).all(|_| check(second, &moves).is_none()), "it was at rest");
        assert_eq!(check(None, &moves), None);
        assert!((0..1_000).any(|_| check(second, &moves).is_some()));
    }

    #[test]
    fn hand_that_swings_under_the_weight_does_not_trip() {
        let mut monitor = UncommandedMotion::default();
        for ms in 0..1_000_u32 {
            // 5 Hz, 40 mrad to either side.
            let dq = 0.04 * 31.4 * 1e-3 * math::cos(31.4e-3 * f64::from(ms));
            assert_eq!(monitor.check(1e-3, true, &joints(1.0), &joints(dq), &[true; 6]), None);
        }
    }
}
