//! Commanded side: destination of commands and source of wrenches. A virtual object in this process, a robot over a
//! network, or a force/torque sensor. One exchange per cycle, which never waits.
//!
//! ```
//! use remote::{Command, Remote, Sensed};
//! use units::spatial::Wrench;
//! use units::time::Instant;
//!
//! /// A robot without contact.
//! struct Robot;
//!
//! impl Remote for Robot {
//!     fn exchange(&mut self, now: Instant, _: &Command) -> Option<Sensed> {
//!         let x_b_m = nalgebra::Isometry3::identity();
//!         Some(Sensed { at: now, f_s: Wrench::ZERO, x_b_m, gripper: None })
//!     }
//! }
//! assert!(Robot.exchange(Instant::ZERO, &Command::HOLD).unwrap().is_possible());
//! ```
#![forbid(unsafe_code)]

pub mod delay;
pub mod gripper;
pub mod link;
pub mod messages;
pub mod model;
pub mod scene;
pub mod site;
pub mod stated;

use std::time::Duration;

use nalgebra::Isometry3;

use crate::stated::Misfit;
use ::robot::chain::MAX_JOINTS;
pub use contract::Gripper;
use contract::{MAX_DISTANCE, MAX_WRENCH, NORM_TOLERANCE, Reason};
use units::spatial::{Motion, Wrench};
use units::time::Instant;

/// Joint positions of a robot, base first, in rad; zero for joints that it does not have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotJoints(pub [f64; MAX_JOINTS]);

/// Command of one cycle to the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Motion of the object.
    pub motion: Motion,
    /// Opening and maximum force of the gripper; `None` leaves it as it is.
    pub gripper: Option<Gripper>,
}

impl Command {
    /// Command of no motion, which leaves the gripper as it is.
    pub const HOLD: Self = Self { motion: Motion::Hold, gripper: None };
}

impl From<Motion> for Command {
    fn from(motion: Motion) -> Self {
        Self { motion, gripper: None }
    }
}

/// Commanded side.
pub trait Remote {
    /// Sends the command of this cycle and returns the newest sample, `None` before the first. Never waits: without a
    /// new sample the last one is returned, and is older.
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<Sensed>;

    /// Begins a new epoch: the node was armed, or a stop was reset. A far side that holds goes on only in one.
    fn begin_epoch(&mut self) {}

    /// Ends the epoch: the node was disarmed or stopped.
    fn end_epoch(&mut self) {}

    /// Returns each reason why the node must not be armed with this commanded side. Called between two cycles.
    fn misfits(&mut self, _now: Instant) -> Vec<Misfit> {
        Vec::new()
    }

    /// Returns the joint positions of the robot, where they are known in this process. For views: nothing acts on them, and
    /// a link does not delay them.
    fn joints(&self) -> Option<RobotJoints> {
        None
    }

    /// Returns a fault of the commanded side or of the way to it, beside the age of its samples.
    fn fault(&mut self) -> Option<SideFault> {
        None
    }
}

/// Fault of the commanded side or of the way to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SideFault {
    /// It holds, although it knows the present epoch.
    Holds(Reason),
    /// One round trip in a hundred is longer than stated.
    Slow {
        /// 99th percentile, in µs.
        p99_us: u32,
        /// Stated maximum, in µs.
        stated_us: u32,
    },
}

impl SideFault {
    /// Returns the fault of a 99th percentile above the stated maximum.
    pub(crate) fn slow(p99: Duration, stated: Duration) -> Self {
        let micros = |duration: Duration| u32::try_from(duration.as_micros()).unwrap_or(u32::MAX);
        Self::Slow { p99_us: micros(p99), stated_us: micros(stated) }
    }
}

/// A sample from the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed {
    /// Sample time on the receiver's clock; errs towards too early.
    pub at: Instant,
    /// Wrench of the environment *on* the object, at the sensor {S}, without payload.
    pub f_s: Wrench,
    /// Pose of the frame under control in its base.
    pub x_b_m: Isometry3<f64>,
    /// Opening and force of the gripper; `None` without one, and where its sensor is invalid.
    pub gripper: Option<Gripper>,
}

impl Sensed {
    /// Returns whether wrench and pose are within their ranges; not whether they are plausible. A gripper does not count.
    pub fn is_possible(&self) -> bool {
        let is_wrench = self.f_s.components().iter().all(|part| part.abs() <= MAX_WRENCH);
        let place = &self.x_b_m.translation.vector;
        let is_place = place.iter().all(|part| part.abs() <= MAX_DISTANCE);
        let is_rotation = (self.x_b_m.rotation.norm() - 1.0).abs() <= NORM_TOLERANCE;
        is_wrench && is_place && is_rotation
    }
}
