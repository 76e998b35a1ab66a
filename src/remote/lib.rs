//! Commanded side, destination of commands and source of wrenches: a virtual object in this process, a robot over a
//! network, or a force/torque sensor. One exchange per cycle, which never blocks.
//!
//! ```
//! use remote::{Command, Remote, RemoteSample};
//! use units::spatial::Wrench;
//! use units::time::Instant;
//!
//! /// A robot without contact.
//! struct Robot;
//!
//! impl Remote for Robot {
//!     fn exchange(&mut self, now: Instant, _: &Command) -> Option<RemoteSample> {
//!         let x_b_m = nalgebra::Isometry3::identity();
//!         Some(RemoteSample { at: now, f_s: Wrench::ZERO, x_b_m, gripper: None })
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
use units::spatial::{CommandMode, Motion, Wrench};
use units::time::Instant;

/// Joint positions of a robot, base first, in rad; zero for absent joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotJoints(pub [f64; MAX_JOINTS]);

/// Command of one cycle to the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Motion of {MRF}.
    pub motion: Motion,
    /// Opening and maximum force of the gripper; `None` leaves it unchanged.
    pub gripper: Option<Gripper>,
}

impl Command {
    /// Command to hold, without a gripper command.
    pub const HOLD: Self = Self { motion: Motion::Hold, gripper: None };
}

impl From<Motion> for Command {
    fn from(motion: Motion) -> Self {
        Self { motion, gripper: None }
    }
}

/// Commanded side, as the cycle of the node uses it.
pub trait Remote {
    /// Sends the command of this cycle and returns the newest sample; `None` before the first. Never blocks: without a new
    /// sample it returns the last one again.
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample>;

    /// Begins a new epoch, after an arming or the reset of a stop. A far side that holds follows again only in a new epoch.
    fn begin_epoch(&mut self) {}

    /// Ends the epoch, after a disarming or a stop.
    fn end_epoch(&mut self) {}

    /// Returns every reason against arming with this commanded side in a command mode. Called between two cycles.
    fn misfits(&mut self, _now: Instant, _mode: CommandMode) -> Vec<Misfit> {
        Vec::new()
    }

    /// Returns the reason against a change to a command mode while armed. Called between two cycles.
    fn mode_misfit(&mut self, _mode: CommandMode) -> Option<Misfit> {
        None
    }

    /// Returns the joint positions of the robot, if this process knows them. They serve views only, and have no link delay.
    fn joints(&self) -> Option<RobotJoints> {
        None
    }

    /// Returns the present error of the commanded side or its link, other than old samples.
    fn error(&mut self) -> Option<SideError> {
        None
    }
}

/// Error of the commanded side or its link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SideError {
    /// The far side holds in the present epoch.
    Holds(Reason),
    /// 1 % of the round trips or more exceed the stated maximum.
    Slow {
        /// 99th percentile, in µs.
        p99_us: u32,
        /// Stated maximum, in µs.
        stated_us: u32,
    },
}

impl SideError {
    /// Creates the error of a 99th percentile above the stated maximum.
    pub(crate) fn slow(p99: Duration, stated: Duration) -> Self {
        let micros = |duration: Duration| u32::try_from(duration.as_micros()).unwrap_or(u32::MAX);
        Self::Slow { p99_us: micros(p99), stated_us: micros(stated) }
    }
}

/// Sample from the commanded side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemoteSample {
    /// Lower bound of the sample time, on the receiver's clock.
    pub at: Instant,
    /// Wrench of the environment *on* the object, at the sensor {S}, without payload.
    pub f_s: Wrench,
    /// Pose of {MRF} in its base.
    pub x_b_m: Isometry3<f64>,
    /// Opening and force of the gripper; `None` without a gripper, or with an invalid sensor.
    pub gripper: Option<Gripper>,
}

impl RemoteSample {
    /// Returns whether wrench and pose are within their ranges. The gripper is not checked.
    pub fn is_possible(&self) -> bool {
        let is_wrench = self.f_s.components().iter().all(|part| part.abs() <= MAX_WRENCH);
        let place = &self.x_b_m.translation.vector;
        let is_place = place.iter().all(|part| part.abs() <= MAX_DISTANCE);
        let is_rotation = (self.x_b_m.rotation.norm() - 1.0).abs() <= NORM_TOLERANCE;
        is_wrench && is_place && is_rotation
    }
}
