//! Control of an arm at the commanded side: joint rates from a command, the measured joints and the wrist sensor.
//!
//! The arm has masses and servos of its own; this law knows its kinematics, its limits and the lag of its servos:
//!
//! ```text
//!  rate   S v_operator + (I - S) v_auto + K_FA f_m          pose   twist that reaches it, over 4 τ
//!  hold   as a pose: the one at which the hold began        then   speed limits, resolved rate, joint limits
//! ```
//!
//! A pose is approached with the gain 1/(4 τ), at which a servo of lag τ does not overshoot. The arm holds where it is: a
//! rate of zero alone would let its servos go on to where the rates before were to lead, which in contact is deeper.
//!
//! A wrench above the limit stops the arm, and so does a measurement that is infinite or NaN; it holds until
//! [`reset`](ArmControl::reset). An arm that is reset while its wrench is above the limit may move out: it stops again where
//! the wrench rises by more than 5 % above its lowest since the reset. Once the wrench is within the limit, the limit acts.

use nalgebra::Isometry3;

use crate::chain::Joints;
use crate::interaction::{Interaction, ToolState};
use crate::object::Servo;
use crate::resolved_rate::ResolvedRate;
use units::spatial::{Motion, Twist, Wrench};

/// Maximum wrench after a reset above the limit, over the lowest one since: noise of the sensor does not stop the arm again.
const MAX_RISE: f64 = 1.05;

/// Maximum contact wrench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchLimit {
    /// Maximum force, in N.
    pub force: f64,
    /// Maximum moment, in N·m.
    pub moment: f64,
}

impl WrenchLimit {
    /// No limit.
    pub const NONE: Self = Self { force: f64::INFINITY, moment: f64::INFINITY };

    /// Returns whether a wrench is within it; NaN is not.
    pub fn allows(&self, f: &Wrench) -> bool {
        f.force.norm() <= self.force && f.moment.norm() <= self.moment
    }

    /// Returns the limit for an arm that is reset at a wrench: each part above its limit may rise by 5 %.
    fn after_reset_at(&self, f: &Wrench) -> Self {
        let part = |limit: f64, now: f64| if now > limit { MAX_RISE * now } else { limit };
        let Self { force, moment } = *self;
        Self { force: part(force, f.force.norm()), moment: part(moment, f.moment.norm()) }
    }

    /// Returns the lower limit of each part.
    const fn min(self, other: Self) -> Self {
        Self { force: self.force.min(other.force), moment: self.moment.min(other.moment) }
    }
}

/// The law and its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmControl {
    law: ResolvedRate,
    servo: Servo,
    interaction: Interaction,
    limit: WrenchLimit,
    /// Limit that acts: above `limit` after a reset above it, until the wrench is within it.
    limit_now: WrenchLimit,
    tool: ToolState,
    qd: Joints,
    /// Contact wrench at {MRF}.
    f_m: Wrench,
    /// Wrench for the operator, at {S}.
    f_s_felt: Wrench,
    is_stopped: bool,
    /// Pose at which the present hold began.
    x_b_h: Option<Isometry3<f64>>,
}

impl ArmControl {
    /// Creates the law for an arm at rest at `q`. `servo` has the lag of its servos and the speed limits of {MRF}.
    pub fn new(
        law: ResolvedRate,
        servo: Servo,
        interaction: Interaction,
        limit: WrenchLimit,
        q: &Joints,
    ) -> Self {
        Self {
            tool: ToolState::at_rest(law.chain().forward(q)),
            law,
            servo,
            interaction,
            limit,
            limit_now: limit,
            qd: Joints::zeros(),
            f_m: Wrench::ZERO,
            f_s_felt: Wrench::ZERO,
            is_stopped: false,
            x_b_h: None,
        }
    }

    /// Takes the joints `q` in rad and the reading of the wrist sensor, measured `dt` s after the last ones; returns the
    /// joint rates to command, in rad/s.
    pub fn step(&mut self, dt: f64, command: &Motion, q: &Joints, reading: &Wrench) -> Joints {
        let is_valid = q.iter().all(|q| q.is_finite()) && reading.is_finite() && dt > 0.0;
        if !is_valid {
            (self.is_stopped, self.x_b_h) = (true, None);
            self.qd = Joints::zeros();
            return self.qd;
        }
        self.observe(dt, q, reading);
        self.is_stopped |= !self.limit_now.allows(&self.f_m);
        self.limit_now = self.limit_now.min(self.limit.after_reset_at(&self.f_m));
        let v_m = self.twist(dt, if self.is_stopped { &Motion::Hold } else { command });
        self.qd = self.law.rates(dt, q, &self.qd, &self.servo.limited(v_m));
        self.qd
    }

    /// Lets the arm move again; out of a contact whose wrench is above the limit, too, but not further in.
    pub fn reset(&mut self) {
        self.is_stopped = false;
        self.limit_now = self.limit.after_reset_at(&self.f_m);
    }

    /// Returns whether the arm has stopped for a wrench above the limit, or a measurement that is infinite or NaN.
    pub const fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Returns the measured pose of {MRF} in {b}.
    pub const fn pose(&self) -> &Isometry3<f64> {
        &self.tool.x_b_m
    }

    /// Returns the sensed contact wrench on the tool, at {MRF} in {MRF}.
    pub const fn contact(&self) -> &Wrench {
        &self.f_m
    }

    /// Returns the wrench for the operator, at {S}.
    pub const fn felt(&self) -> &Wrench {
        &self.f_s_felt
    }

    /// Updates pose, twist and contact from the measurements.
    fn observe(&mut self, dt: f64, q: &Joints, reading: &Wrench) {
        let x_b_m = self.law.chain().forward(q);
        let v_m = Twist::reaching(&(self.tool.x_b_m.inverse() * x_b_m), dt);
        let v_dot_m = (v_m + self.tool.v_m * -1.0) * dt.recip();
        self.tool = ToolState { x_b_m, v_m, v_dot_m };
        let f_s = self.interaction.contact(&self.tool, reading);
        self.f_m = f_s.at(&self.interaction.sensor.x_m_s);
        self.f_s_felt = self.interaction.felt(&self.tool, reading);
    }

    /// Returns the twist of {MRF} that a command asks for. A command that is infinite or NaN holds.
    fn twist(&mut self, dt: f64, command: &Motion) -> Twist {
        let v_m = match command {
            Motion::Hold => None,
            Motion::Rate(v_m) => Some(self.interaction.rate(v_m, &self.f_m)),
            Motion::Pose(x_b_d) => Some(self.reaching(x_b_d, dt)),
        };
        if let Some(v_m) = v_m.filter(Twist::is_finite) {
            self.x_b_h = None;
            return v_m;
        }
        let x_b_h = *self.x_b_h.get_or_insert(self.tool.x_b_m);
        self.reaching(&x_b_h, dt)
    }

    /// Returns the twist that reaches a pose.
    fn reaching(&self, x_b_d: &Isometry3<f64>, dt: f64) -> Twist {
        let reach_time = (4.0 * self.servo.time_constant()).max(dt);
        Twist::reaching(&(self.tool.x_b_m.inverse() * x_b_d), reach_time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accommodation::Accommodation;
    use crate::testing::{self, puma};

    const DT: f64 = 1e-3;

    fn control(limit: WrenchLimit) -> (ArmControl, Joints) {
        let q = testing::posture(6);
        let servo = Servo::new(0.01, 0.5, 2.0).unwrap();
        let accommodation = Accommodation::new([0.001; 6], [0.0; 6]).unwrap();
        let interaction = Interaction { accommodation, ..Interaction::default() };
        (ArmControl::new(testing::law(puma(), 50.0), servo, interaction, limit, &q), q)
    }

    /// Follows a command with ideal joints for `cycles` periods.
    fn followed(
        control: &mut ArmControl,
        q: &mut Joints,
        command: &Motion,
        reading: &Wrench,
        cycles: u32,
    ) {
        for _ in 0..cycles {
            *q += control.step(DT, command, q, reading) * DT;
        }
    }

    #[test]
    fn pose_is_reached_and_kept() {
        let (mut control, mut q) = control(WrenchLimit::NONE);
        let x_b_d =
            control.pose() * Isometry3::new([0.05, -0.03, -0.08].into(), [0.2, -0.1, 0.3].into());
        followed(&mut control, &mut q, &Motion::Pose(x_b_d), &Wrench::ZERO, 2_000);
        let off = control.pose().inverse() * x_b_d;
        assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6, "{off}");
    }

    #[test]
    fn held_rate_yields_to_a_push() {
        let (mut control, mut q) = control(WrenchLimit::NONE);
        let push = Wrench::from_components([0.0, 0.0, -20.0, 0.0, 0.0, 0.0]);
        let rate = Motion::Rate(Twist::from_components([0.0, 0.0, 0.02, 0.0, 0.0, 0.0]));
        let before = *control.pose();
        followed(&mut control, &mut q, &rate, &push, 1_000);
        let moved = before.inverse() * control.pose();
        assert!(moved.translation.vector.norm() < 1e-6, "{moved}");
    }

    #[test]
    fn wrench_above_the_limit_stops_until_reset() {
        let (mut control, mut q) = control(WrenchLimit { force: 50.0, moment: 5.0 });
        let rate = Motion::Rate(Twist::from_components([0.0, 0.0, 0.05, 0.0, 0.0, 0.0]));
        followed(&mut control, &mut q, &rate, &Wrench::ZERO, 200);
        let push = Wrench::from_components([0.0, 0.0, -60.0, 0.0, 0.0, 0.0]);
        followed(&mut control, &mut q, &rate, &push, 1);
        assert!(control.is_stopped());
        let stopped_at = *control.pose();
        followed(&mut control, &mut q, &rate, &Wrench::ZERO, 1_000);
        let rest = control.step(DT, &rate, &q, &Wrench::ZERO);
        assert!(rest.norm() < 1e-6, "{rest}");
        let off = stopped_at.inverse() * control.pose();
        assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6, "{off}");
        control.reset();
        assert!(control.step(DT, &rate, &q, &Wrench::ZERO).norm() > 0.0);
    }

    /// Returns a push on the tool against its approach, in N.
    fn push(force: f64) -> Wrench {
        Wrench::from_components([0.0, 0.0, -force, 0.0, 0.0, 0.0])
    }

    #[test]
    fn arm_reset_above_its_limit_moves_out_but_not_in() {
        let limit = WrenchLimit { force: 50.0, moment: 5.0 };
        let rate = |speed| Motion::Rate(Twist::from_components([0.0, 0.0, speed, 0.0, 0.0, 0.0]));
        let stopped = || {
            let (mut control, mut q) = control(limit);
            followed(&mut control, &mut q, &rate(0.05), &push(60.0), 10);
            assert!(control.is_stopped());
            control.reset();
            (control, q)
        };
        let (mut inwards, mut q) = stopped();
        for force in [60.0, 61.0, 62.0, 62.9] {
            followed(&mut inwards, &mut q, &rate(0.05), &push(force), 1);
            assert!(!inwards.is_stopped(), "within 5 %");
        }
        followed(&mut inwards, &mut q, &rate(0.05), &push(63.1), 1);
        assert!(inwards.is_stopped());

        let (mut outwards, mut q) = stopped();
        let before = *outwards.pose();
        for force in (0..=20).map(|step| 60.0 - f64::from(step)) {
            followed(&mut outwards, &mut q, &rate(-0.05), &push(force), 10);
            assert!(!outwards.is_stopped(), "{force} N");
        }
        assert!((before.inverse() * outwards.pose()).translation.z < -0.005);
        followed(&mut outwards, &mut q, &rate(0.05), &push(50.1), 1);
        assert!(outwards.is_stopped(), "the limit is full again");
    }

    #[test]
    fn wrench_that_fell_after_a_reset_rises_by_5_percent_only() {
        let (mut control, mut q) = control(WrenchLimit { force: 50.0, moment: 5.0 });
        for force in [80.0, 80.0, 60.0] {
            followed(&mut control, &mut q, &Motion::Hold, &push(force), 1);
            if force >= 80.0 {
                control.reset();
            }
        }
        assert!(!control.is_stopped());
        followed(&mut control, &mut q, &Motion::Hold, &push(64.0), 1);
        assert!(control.is_stopped());
    }

    #[test]
    fn reset_above_the_force_limit_keeps_that_of_the_moment() {
        let (mut control, mut q) = control(WrenchLimit { force: 50.0, moment: 5.0 });
        followed(&mut control, &mut q, &Motion::Hold, &push(60.0), 1);
        control.reset();
        let turning = Wrench::from_components([0.0, 0.0, -60.0, 5.1, 0.0, 0.0]);
        followed(&mut control, &mut q, &Motion::Hold, &turning, 1);
        assert!(control.is_stopped());
    }

    #[test]
    fn invalid_measurements_stop_the_arm() {
        for (part, reading) in [(f64::NAN, 0.0), (0.0, f64::NAN)] {
            let (mut control, mut q) = control(WrenchLimit::NONE);
            q[2] += part;
            let reading = Wrench::from_components([reading; 6]);
            let rate = Motion::Rate(Twist::from_components([0.1; 6]));
            assert_eq!(control.step(DT, &rate, &q, &reading), Joints::zeros());
            assert!(control.is_stopped());
        }
    }
}
