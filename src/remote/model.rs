//! Virtual model of remote hardware: mode 3 of the paper (section 4). An arm follows the sensed pose, for views. An object
//! is predicted from the commands, to detect hardware that does not follow them.
//!
//! ```text
//!  commands ──► history ── up to the time of the sample ──► predicted object ──┐
//!                                                                 ▲            ├──► difference
//!  samples ──┬── wrench ──────── force accommodation ─────────────┘            │
//!            └── pose ──┬───────────────────────────────────────────────────────┘
//!                       └──► arm of the views
//! ```
//!
//! The time of a sample is that of the newest command that the robot had received (its echo, docs/link.md). The prediction
//! uses all commands up to that one, so delay, jitter and loss affect both alike. During a hold the predicted object is
//! reset to the sensed pose. It is a free object without joint limits, so a robot at a joint limit differs from it.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Isometry3;

use crate::site::Virtual;
use crate::{RemoteSample, RobotJoints};
use robot::interaction::{Interaction, ToolState};
use robot::object::Object;
use units::spatial::{Motion, Wrench};
use units::time::Instant;

/// Maximum number of stored commands: 100 ms, the maximum age of a sample, at 4 kHz, twice over for an overrun.
const HISTORY: usize = 800;

/// Maximum periods of motion between two commands; for a longer stall the link sends a hold.
const MAX_PERIODS: u32 = 10;

/// Time constant of the shown arm behind the sensed pose, in s, so that joints with limited acceleration do not oscillate.
const SHOWN_LAG: f64 = 0.02;

/// Magnitude of the difference of two poses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Distance of the origins, in m.
    pub distance: f64,
    /// Angle of the rotation between them, in rad.
    pub angle: f64,
}

impl Difference {
    /// Returns the difference of two poses in the same base.
    fn between(x_b_m: &Isometry3<f64>, other: &Isometry3<f64>) -> Self {
        let between = x_b_m.inv_mul(other);
        Self { distance: between.translation.vector.norm(), angle: between.rotation.angle() }
    }

    /// Returns the maximum of both distances and of both angles.
    #[must_use]
    pub const fn max(self, other: Self) -> Self {
        Self { distance: self.distance.max(other.distance), angle: self.angle.max(other.angle) }
    }

    /// Returns whether distance or angle is beyond a limit, or NaN.
    pub fn exceeds(&self, limit: &Self) -> bool {
        !(self.distance <= limit.distance && self.angle <= limit.angle)
    }
}

/// Arm for views, and predicted object.
#[derive(Clone, Debug)]
pub struct Model {
    limit: Difference,
    interaction: Interaction,
    max_step: Duration,
    /// Tool with its arm, for views; `None` without an arm.
    shown: Option<Object>,
    shown_at: Option<Instant>,
    predicted: Object,
    /// Commands newer than the newest sample, oldest first.
    history: VecDeque<(Instant, Motion)>,
    /// Present command of the predicted object.
    followed: Motion,
    predicted_at: Option<Instant>,
    difference: Option<Difference>,
}

impl Model {
    /// Creates the model of a robot with the parameters of `remote` and one exchange per `period`. A difference beyond
    /// `limit` is reported by [`Self::excess`].
    pub fn new(remote: &Virtual, limit: Difference, period: Duration) -> Self {
        let Virtual { x_b_m, interaction, servo, arm, .. } = *remote;
        let shown = |arm| Object::new(servo.with_lag(SHOWN_LAG), x_b_m).held_by(arm);
        Self {
            limit,
            interaction,
            max_step: period * MAX_PERIODS,
            shown: arm.map(shown),
            shown_at: None,
            predicted: Object::new(servo, x_b_m).with_interaction(interaction),
            history: VecDeque::with_capacity(HISTORY),
            followed: Motion::Hold,
            predicted_at: None,
            difference: None,
        }
    }

    /// Updates the model with the command of this cycle and the newest valid sample.
    pub fn exchange(&mut self, now: Instant, command: &Motion, newest: Option<&RemoteSample>) {
        if self.history.len() == HISTORY {
            self.history.pop_front();
        }
        self.history.push_back((now, *command));
        let Some(sensed) = newest else { return };
        self.show(now, &sensed.x_b_m);
        if self.predicted_at.is_none_or(|at| at < sensed.at) {
            self.predict(sensed);
        }
    }

    /// Returns the difference of predicted and sensed pose; `None` before the first sample.
    pub const fn difference(&self) -> Option<Difference> {
        self.difference
    }

    /// Returns the difference if it exceeds the limit.
    pub fn excess(&self) -> Option<Difference> {
        self.difference.filter(|difference| difference.exceeds(&self.limit))
    }

    /// Returns the joint positions of the arm for views; `None` without an arm.
    pub fn joints(&self) -> Option<RobotJoints> {
        self.shown?.arm().map(|arm| RobotJoints((*arm.q()).into()))
    }

    /// Moves the arm for views to the sensed pose, within its joint limits.
    fn show(&mut self, now: Instant, x_b_m: &Isometry3<f64>) {
        let dt = self.time_since(self.shown_at, now);
        self.shown_at = Some(now);
        if let Some(shown) = self.shown.as_mut().filter(|_| dt > 0.0) {
            shown.step(dt, &Motion::Pose(*x_b_m), &Wrench::ZERO);
        }
    }

    /// Advances the predicted object by the commands up to the time of the sample.
    fn predict(&mut self, sensed: &RemoteSample) {
        let f_m = self.contact(sensed);
        while let Some((at, command)) = self.history.front().copied()
            && at <= sensed.at
        {
            self.step(at, &f_m);
            self.followed = command;
            self.history.pop_front();
        }
        self.step(sensed.at, &f_m);
        if self.followed == Motion::Hold {
            self.predicted.place(sensed.x_b_m);
        }
        self.difference = Some(Difference::between(self.predicted.pose(), &sensed.x_b_m));
    }

    fn step(&mut self, until: Instant, f_m: &Wrench) {
        let dt = self.time_since(self.predicted_at, until);
        self.predicted_at = Some(until);
        // With a time of zero, the object would jump to a commanded pose.
        if dt > 0.0 {
            self.predicted.step(dt, &self.followed, f_m);
        }
    }

    /// Returns the contact wrench at {MRF}, for accommodation.
    fn contact(&self, RemoteSample { f_s, x_b_m, .. }: &RemoteSample) -> Wrench {
        let f_s = if self.interaction.feels_payload {
            self.interaction.contact(&ToolState::at_rest(*x_b_m), f_s)
        } else {
            *f_s
        };
        f_s.at(&self.interaction.sensor.x_m_s)
    }

    fn time_since(&self, before: Option<Instant>, now: Instant) -> f64 {
        before.map_or(0.0, |before| now.since(before).min(self.max_step).as_secs_f64())
    }
}

#[cfg(test)]
mod tests;
