//! The virtual model beside remote hardware: mode 3 of the paper (section 4). An arm follows the sensed pose, for views; an
//! object is predicted from the commands, so that hardware that does not follow them is found.
//!
//! ```text
//!  commands ──► history ── up to the time of the sample ──► predicted object ──┐
//!                                                                 ▲            ├──► difference
//!  samples ──┬── wrench ──────── force accommodation ─────────────┘            │
//!            └── pose ──┬───────────────────────────────────────────────────────┘
//!                       └──► arm of the views
//! ```
//!
//! A sample has the time of the newest command that the robot had received (its echo, docs/link.md). The prediction has
//! every command up to that one, those of a measured round trip ago, so delay, jitter and loss age both alike. While
//! nothing is commanded, the predicted object stands where the robot is. It is free: it has no joints that could be at
//! their limit, so a robot that stands at one differs.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Isometry3;

use crate::site::Virtual;
use crate::{RobotJoints, Sensed};
use robot::interaction::{Interaction, ToolState};
use robot::object::Object;
use units::spatial::{Motion, Wrench};
use units::time::Instant;

/// Commands that are kept: 100 ms, the most that a sample may be old, at 4 kHz, and as many again for an overrun.
const HISTORY: usize = 800;

/// Periods of motion at most between two commands: a cycle that stalls longer has a hold sent in its place.
const MAX_PERIODS: u32 = 10;

/// Lag of what views show behind the sensed pose, in s: joints with a maximum acceleration swing without one.
const SHOWN_LAG: f64 = 0.02;

/// Difference of two poses, without direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Distance of the origins, in m.
    pub distance: f64,
    /// Angle of the rotation between them, in rad.
    pub angle: f64,
}

impl Difference {
    /// Returns the difference of two poses in the same base.
    fn of(x_b_m: &Isometry3<f64>, other: &Isometry3<f64>) -> Self {
        let between = x_b_m.inv_mul(other);
        Self { distance: between.translation.vector.norm(), angle: between.rotation.angle() }
    }

    /// Returns the greater distance and the greater angle of two.
    #[must_use]
    pub const fn max(self, other: Self) -> Self {
        Self { distance: self.distance.max(other.distance), angle: self.angle.max(other.angle) }
    }

    /// Returns whether distance or angle is beyond a limit, or NaN.
    pub fn exceeds(&self, limit: &Self) -> bool {
        !(self.distance <= limit.distance && self.angle <= limit.angle)
    }
}

/// The arm that views show, and the object that is predicted.
#[derive(Clone, Debug)]
pub struct Model {
    limit: Difference,
    interaction: Interaction,
    max_step: Duration,
    /// Tool for views, in the arm that holds it; `None` without one.
    shown: Option<Object>,
    shown_at: Option<Instant>,
    predicted: Object,
    /// Commands that the newest sample is too old for, oldest first.
    history: VecDeque<(Instant, Motion)>,
    /// Command that the predicted object follows.
    followed: Motion,
    predicted_at: Option<Instant>,
    difference: Option<Difference>,
}

impl Model {
    /// Creates the model of a robot with the figures of `remote`, one exchange per `period`. Beyond `limit` it does not follow.
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

    /// Takes the command of this cycle, and the newest valid sample.
    pub fn exchange(&mut self, now: Instant, command: &Motion, newest: Option<&Sensed>) {
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

    /// Returns predicted less sensed pose; `None` before the first sample.
    pub const fn difference(&self) -> Option<Difference> {
        self.difference
    }

    /// Returns the difference, if it is beyond its limit.
    pub fn fault(&self) -> Option<Difference> {
        self.difference.filter(|difference| difference.exceeds(&self.limit))
    }

    /// Returns the joint positions of the arm that follows the sensed pose.
    pub fn joints(&self) -> Option<RobotJoints> {
        self.shown?.arm().map(|arm| RobotJoints((*arm.q()).into()))
    }

    /// Moves what views show to the sensed pose, within the limits of its joints.
    fn show(&mut self, now: Instant, x_b_m: &Isometry3<f64>) {
        let dt = self.time_since(self.shown_at, now);
        self.shown_at = Some(now);
        if let Some(shown) = self.shown.as_mut().filter(|_| dt > 0.0) {
            shown.step(dt, &Motion::Pose(*x_b_m), &Wrench::ZERO);
        }
    }

    /// Moves the predicted object by the commands up to the time of the sample.
    fn predict(&mut self, sensed: &Sensed) {
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
        self.difference = Some(Difference::of(self.predicted.pose(), &sensed.x_b_m));
    }

    fn step(&mut self, until: Instant, f_m: &Wrench) {
        let dt = self.time_since(self.predicted_at, until);
        self.predicted_at = Some(until);
        // No time, no motion: a pose would be reached at once.
        if dt > 0.0 {
            self.predicted.step(dt, &self.followed, f_m);
        }
    }

    /// Returns the wrench at {MRF} that the robot yields to.
    fn contact(&self, Sensed { f_s, x_b_m, .. }: &Sensed) -> Wrench {
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
