//! Record of one cycle, which the caller of [`Node::cycle`](crate::Node::cycle) logs, sends or drops.
//!
//! The controller's intermediates are those from which the torques of the cycle were computed.

use std::time::Duration;

use derive_more::Display;
use nalgebra::Isometry3;

use crate::cause::Cause;
use crate::cycle_times::CycleTimes;
use crate::push::Push;
use crate::trial::status::TrialStatus;
use crate::zero::ZeroState;
use controller::Output;
use controller::adjustment::AdjustmentError;
use remote::model::Difference;
use remote::{Gripper, RobotJoints};
use units::adjustment::Adjustment;
use units::drive::Counts;
use units::spatial::Wrench;
use units::time::Instant;

/// Mode of the node. Only [`safety`](crate::safety) changes it.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Hash)]
#[display("{}", self.name())]
pub enum Mode {
    /// Zero torque until all drives are enabled: network boot, proof tests, and a reset that does not boot the network.
    Boot,
    /// Drives enabled at zero torque.
    Ready,
    /// Gravity compensation; commands and reflection wait for the deadman.
    Armed,
    /// Commands are sent, and wrenches are reflected.
    Engaged,
    /// S1: gravity compensation alone, and no commands, until a reset.
    ReflectionOff,
    /// S2: a fault; torque is zero, and the drives are off 100 ms later.
    ZeroTorque,
    /// S3, or the orderly stop: the drives are off until a reset.
    DrivesOff,
    /// While the deadman is held the arm moves by itself: the hold moves it, with its weight carried, or one drive alone is tried.
    /// Last, so that recorded numbers keep their meaning.
    Measuring,
}

impl Mode {
    /// All modes, in the order of the mode graph.
    pub const ALL: [Self; 8] = [
        Self::Boot,
        Self::Ready,
        Self::Armed,
        Self::Engaged,
        Self::ReflectionOff,
        Self::ZeroTorque,
        Self::DrivesOff,
        Self::Measuring,
    ];

    /// Returns whether only a reset ends this mode.
    pub const fn is_latched(self) -> bool {
        match self {
            Self::Boot | Self::Ready | Self::Armed | Self::Engaged | Self::Measuring => false,
            Self::ReflectionOff | Self::ZeroTorque | Self::DrivesOff => true,
        }
    }

    /// Returns whether torque stays zero until a reset.
    pub const fn is_stopped(self) -> bool {
        matches!(self, Self::ZeroTorque | Self::DrivesOff)
    }

    /// Returns whether torques other than zero may be sent.
    pub const fn allows_torque(self) -> bool {
        match self {
            Self::Armed | Self::Engaged | Self::ReflectionOff | Self::Measuring => true,
            Self::Boot | Self::Ready | Self::ZeroTorque | Self::DrivesOff => false,
        }
    }

    /// Returns its number, 0 to 7.
    pub const fn code(self) -> u8 {
        match self {
            Self::Boot => 0,
            Self::Ready => 1,
            Self::Armed => 2,
            Self::Engaged => 3,
            Self::ReflectionOff => 4,
            Self::ZeroTorque => 5,
            Self::DrivesOff => 6,
            Self::Measuring => 7,
        }
    }

    /// Returns its lower-case name, as `ctl status` prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Boot => "boot",
            Self::Ready => "ready",
            Self::Armed => "armed",
            Self::Engaged => "engaged",
            Self::ReflectionOff => "reflection-off",
            Self::ZeroTorque => "zero-torque",
            Self::DrivesOff => "drives-off",
            Self::Measuring => "measuring",
        }
    }
}

/// Record of one cycle.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Number of the cycle, from 1.
    pub cycle: u64,
    /// Time at which its SYNC was sent.
    pub at: Instant,
    /// Mode at its end.
    pub mode: Mode,
    /// First cause of the latched stop.
    pub cause: Option<Cause>,
    /// Number of cycles so far with torques too late to be sent, or with a skipped SYNC.
    pub overruns: u64,
    /// Times of its steps.
    pub times: CycleTimes,
    /// Joints whose sample arrived in time.
    pub sampled: [bool; 6],
    /// Set if a switch box is configured, which arming requires.
    pub has_switch_box: bool,
    /// Inputs of the switch box; `None` if they are missing.
    pub inputs: Option<u8>,
    /// Wrench of the environment on the object at {S}, payload removed.
    pub f_s: Wrench,
    /// Pose of the object in its base.
    pub x_b_m: Isometry3<f64>,
    /// Age of the newest sample of the commanded side at SYNC; `None` before the first.
    pub sample_age: Option<Duration>,
    /// Joint positions of the robot in rad, if known in this process; zero for joints that it does not have.
    pub q_r: Option<RobotJoints>,
    /// Difference between predicted and sensed pose of the robot; `None` without a model or a sample.
    pub model: Option<Difference>,
    /// Gripper; `None` if the switch box has no input for one.
    pub gripper: Option<GripperRecord>,
    /// Press of a button in this cycle that was refused.
    pub refused_press: Option<RefusedPress>,
    /// Output and intermediates of the controller.
    pub output: Output,
    /// Target torques (6071h) that the drives hold, in ‰ of rated torque.
    pub targets: [i16; 6],
    /// Newest trial of one drive since the last boot.
    pub trial: Option<TrialStatus>,
    /// Joints whose drives do not report that they are off, although disable voltage was sent by RPDO and by SDO.
    pub not_off: [bool; 6],
    /// Drives that may push at zero target torque. Not to be used in a mode that allows torque.
    pub pushes: [Push; 6],
    /// Newest actual position (6064h) of each drive, as received.
    pub counts: [Counts; 6],
    /// State of each joint's zero. Positions of a joint with an unknown zero are without meaning.
    pub zeros: [ZeroState; 6],
    /// Counters of SDO transfers.
    pub sdo: SdoCounters,
}

impl Record {
    /// Returns whether the mode allows no torque, and no drive may push.
    pub fn is_torque_free(&self) -> bool {
        !self.mode.allows_torque() && self.pushes == [Push::Excluded; 6]
    }
}

/// Gripper in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GripperRecord {
    /// Opening and maximum force that the operator commands; `None` before the first engagement after an arming.
    pub command: Option<Gripper>,
    /// Opening and force in the newest sample of the commanded side; `None` if it has no gripper.
    pub measured: Option<Gripper>,
}

/// Adjustment of a pressed button that was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefusedPress {
    /// Adjustment that the press requested.
    pub adjustment: Adjustment,
    /// Reason.
    pub refused: AdjustmentError,
}

/// Counters of SDO transfers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SdoCounters {
    /// SDO uploads by other clients from nodes of this master, since the start.
    pub foreign_uploads: u32,
    /// Objects of the proof test whose last reading back failed.
    pub unread_settings: u32,
}
