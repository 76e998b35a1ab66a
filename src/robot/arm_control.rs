//! Control of an arm at the commanded side: joint rates from a command, the measured joints and the wrist sensor.
//!
//! The law uses the kinematics and limits of the arm and the lag of its servos, but not its masses:
//!
//! ```text
//!  rate   S v_operator + (I - S) v_auto + K_FA f_m          pose   twist that reaches it, over 4 τ
//!  hold   as a pose: the one at the start of the hold       then   speed limits, resolved rate, joint limits
//! ```
//!
//! A pose is approached with the gain 1/(4 τ), at which a servo of lag τ does not overshoot. A hold commands a pose and
//! not a rate of zero, after which lagging servos would move on, in contact deeper into the surface.
//!
//! A wrench above the limit stops the arm, and so does a measurement that is infinite or NaN, until
//! [`reset`](ArmControl::reset). After a reset with the wrench still above the limit, the arm yields, and may move out
//! and sideways. Commands against the wrench have no effect ([`WrenchLimit::without_advance`]). The arm stops again if
//! the wrench rises by more than 5 % above its minimum since the reset: the environment moves, or a servo lags. The
//! configured limit applies again as soon as the wrench is within it.

use nalgebra::Isometry3;

use crate::chain::Joints;
use crate::interaction::{Interaction, ToolState};
use crate::object::Servo;
use crate::resolved_rate::ResolvedRate;
use crate::wrench_limit::WrenchLimit;
use units::spatial::{Motion, Twist, Wrench};

/// Arm control with its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmControl {
    law: ResolvedRate,
    servo: Servo,
    interaction: Interaction,
    limit: WrenchLimit,
    /// Effective limit: raised by a reset above `limit`, until the wrench is within it.
    limit_now: WrenchLimit,
    tool: ToolState,
    qd: Joints,
    /// Contact wrench at {MRF}.
    f_m: Wrench,
    /// Wrench for the operator, at {S} in {S}: the contact, with the payload if so configured.
    f_s_operator: Wrench,
    is_stopped: bool,
    /// Pose at the start of the present hold.
    x_b_h: Option<Isometry3<f64>>,
}

impl ArmControl {
    /// Creates the law for an arm at rest at `q`. `servo` holds the lag of the arm's servos and the speed limits of {MRF}.
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
            f_s_operator: Wrench::ZERO,
            is_stopped: false,
            x_b_h: None,
        }
    }

    /// Computes the joint rates to command, in rad/s, from joint positions `q` in rad and a reading of the wrist sensor.
    /// `dt` is the time since the last ones, in s.
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

    /// Ends a stop. With the contact wrench above the limit, the arm may only move out and sideways.
    pub fn reset(&mut self) {
        self.is_stopped = false;
        self.limit_now = self.limit.after_reset_at(&self.f_m);
    }

    /// Returns whether a wrench above the limit, or an infinite or NaN measurement, has stopped the arm.
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
    pub const fn operator_wrench(&self) -> &Wrench {
        &self.f_s_operator
    }

    /// Updates pose, twist and contact from the measurements.
    fn observe(&mut self, dt: f64, q: &Joints, reading: &Wrench) {
        let x_b_m = self.law.chain().forward(q);
        let v_m = Twist::reaching(&(self.tool.x_b_m.inverse() * x_b_m), dt);
        let v_dot_m = (v_m + self.tool.v_m * -1.0) * dt.recip();
        self.tool = ToolState { x_b_m, v_m, v_dot_m };
        let f_s = self.interaction.contact(&self.tool, reading);
        self.f_m = f_s.at(&self.interaction.sensor.x_m_s);
        self.f_s_operator = self.interaction.operator_wrench(&self.tool, reading);
    }

    /// Returns the twist of {MRF} that a command requests. A command that is infinite or NaN holds.
    fn twist(&mut self, dt: f64, command: &Motion) -> Twist {
        let v_m = match command {
            Motion::Hold => None,
            Motion::Rate(v_m) => {
                let Interaction { shared, accommodation, .. } = &self.interaction;
                let v_m = self.limit.without_advance(&shared.rate(v_m), &self.f_m);
                Some(accommodation.rate(&v_m, &self.f_m))
            }
            Motion::Pose(x_b_d) => {
                Some(self.limit.without_advance(&self.reaching(x_b_d, dt), &self.f_m))
            }
        };
        if let Some(v_m) = v_m.filter(Twist::is_finite) {
            self.x_b_h = None;
            return v_m;
        }
        let x_b_h = *self.x_b_h.get_or_insert(self.tool.x_b_m);
        self.reaching(&x_b_h, dt)
    }

    /// Returns the twist that approaches a pose within 4 τ, or within `dt` if that is longer.
    fn reaching(&self, x_b_d: &Isometry3<f64>, dt: f64) -> Twist {
        let reach_time = (4.0 * self.servo.time_constant()).max(dt);
        Twist::reaching(&(self.tool.x_b_m.inverse() * x_b_d), reach_time)
    }
}

#[cfg(test)]
mod tests;
