//! Figures of a far side in the configuration, and their comparison with its capability before arming.

use thiserror::Error;

use crate::delay::HOLD_AFTER;
use contract::{Capability, InvalidCapability, PayloadRemoval, Pose, Reject, VERSION};
use robot::interaction::Interaction;
use robot::object::Servo;
use units::spatial::CommandMode;

/// Relative tolerance of a comparison, since each end may have rounded the same figure.
const TOLERANCE: f64 = 1e-6;

/// Distance, in m, by which a robot at a limit of its workspace may be beyond it: the error of its servos.
const WORKSPACE_MARGIN: f64 = 1e-3;

/// Figures of the far side that the gain check and the limits assume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedCapability {
    /// K_FA per axis of {MRF}, in m/(s·N) and rad/(s·N·m).
    pub accommodation: [f64; 6],
    /// Deadband of accommodation per axis, in N and N·m.
    pub deadband: [f64; 6],
    /// Maximum servo lag, in s.
    pub servo_lag: f64,
    /// Maximum speed of {MRF}, in m/s and rad/s.
    pub max_speed: [f64; 2],
    /// Minimum removal of the payload from the wrench.
    pub payload_removal: PayloadRemoval,
    /// Maximum stiffness of a contact, in N/m.
    pub stiffest_contact: f64,
    /// Maximum cycle period, in s; infinite if not configured.
    pub sample_period: f64,
    /// Maximum age of a command that the far side follows, in s.
    pub hold_after: f64,
    /// Minimum sensor range, in N and N·m; zero if not configured.
    pub sensor_range: [f64; 2],
}

/// Reason why a far side does not fit the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum Misfit {
    /// No process is connected, or it does not answer.
    #[error("the far side does not answer: connect it to the link's socket")]
    Absent,
    /// Messages of another contract, version or arm.
    #[error("messages of the far side have no effect: {}", foreign(*.0))]
    Foreign(Reject),
    /// Its capability has not been received.
    #[error("the far side has not said yet what it can do: try again")]
    Unknown,
    /// Its capability was rejected.
    #[error("the far side's capability is rejected: {0}: correct the far side by docs/link.md")]
    Rejected(InvalidCapability),
    /// The far side follows another node, with this session.
    #[error("the far side follows another node, of session {0:016x}: stop that one first")]
    Led(u64),
    /// The far side has received no fresh command from any node.
    #[error("the far side follows no node: this node's commands reach it too late, or not at all")]
    Unled,
    /// Its newest sample has no wrench or no pose.
    #[error("the far side's newest sample has no valid wrench and pose: see its log")]
    Senseless,
    /// The far side lacks a required function.
    #[error("the far side {0}")]
    Lacks(&'static str),
    /// A figure is worse than configured.
    #[error("{key} is {stated}, and the far side has {found}: correct the key, or the far side")]
    Worse {
        /// Key of the configuration.
        key: &'static str,
        /// Configured value, in the unit of the key.
        stated: f64,
        /// Figure of the far side, in the unit of the key.
        found: f64,
    },
    /// The robot is outside the workspace of its own capability.
    #[error(
        "the far side is outside its own workspace: {axis} of {{MRF}} is {position:.4} m, and must be within \
         {low}..={high}: move the robot, or correct the workspace"
    )]
    Outside {
        /// Axis of {b}.
        axis: &'static str,
        /// Position of {MRF}, in m.
        position: f64,
        /// Minimum position, in m.
        low: f64,
        /// Maximum position, in m.
        high: f64,
    },
    /// The far side removes less of the payload than configured.
    #[error("[remote] states that the far side removes the payload's {stated}; it removes {found}")]
    Payload {
        /// Configured removal.
        stated: PayloadRemoval,
        /// Removal of the far side.
        found: PayloadRemoval,
    },
}

/// Returns the remedy for messages of another contract, version or arm.
fn foreign(reject: Reject) -> String {
    if reject == Reject::Arm {
        "another arm than remote.link.arm: correct the key, or the far side".to_owned()
    } else if reject == Reject::Version {
        format!("another version of the contract than {VERSION}: update the older end")
    } else {
        format!("{reject}; docs/link.md has those that have one")
    }
}

impl StatedCapability {
    /// Creates the figures of `[remote]`; those of `[remote.link]` are their defaults.
    pub fn from_interaction(interaction: &Interaction, servo: &Servo) -> Self {
        let Interaction { payload, removes_inertia, feels_payload, accommodation, .. } =
            interaction;
        let payload_removal = match (*feels_payload || payload.mass() <= 0.0, removes_inertia) {
            (true, _) => PayloadRemoval::None,
            (false, true) => PayloadRemoval::Inertia,
            (false, false) => PayloadRemoval::Weight,
        };
        Self {
            accommodation: *accommodation.gain(),
            deadband: *accommodation.deadband(),
            servo_lag: servo.time_constant(),
            max_speed: servo.max_speeds(),
            payload_removal,
            stiffest_contact: f64::INFINITY,
            sample_period: f64::INFINITY,
            hold_after: HOLD_AFTER.as_secs_f64(),
            sensor_range: [0.0; 2],
        }
    }

    /// Returns the capability of a robot without a gripper that has exactly these figures. `workspace` is in {b}, in m.
    pub const fn capability(&self, workspace: [[f64; 3]; 2]) -> Capability {
        Capability {
            senses_wrench: true,
            senses_pose: true,
            has_gripper: false,
            follows_rates: true,
            follows_poses: true,
            payload_removal: self.payload_removal,
            accommodation: self.accommodation,
            deadband: self.deadband,
            servo_lag: self.servo_lag,
            sample_period: self.sample_period,
            hold_after: self.hold_after,
            sensor_range: self.sensor_range,
            stiffest_contact: self.stiffest_contact,
            max_speed: self.max_speed,
            workspace,
        }
    }

    /// Returns each reason against a far side in a command mode: functions that it lacks, figures worse than configured, and
    /// axes on which it is outside its workspace. `pose` is the newest; without one the workspace is not compared.
    pub fn misfits(&self, has: &Capability, mode: CommandMode, pose: Option<&Pose>) -> Vec<Misfit> {
        let lacks = [
            (has.senses_wrench, "has no force/torque sensor"),
            (has.senses_pose, "does not measure its pose"),
        ];
        let lacks =
            lacks.into_iter().filter(|(has, _)| !has).map(|(_, reason)| Misfit::Lacks(reason));
        let lacks = lacks.chain(mode_misfit(has, mode));
        let outside = pose.filter(|_| has.senses_pose).map(|pose| outside(has, pose));
        let worse = self.figures(has).into_iter().filter_map(Figure::misfit);
        let (stated, found) = (self.payload_removal, has.payload_removal);
        let payload = (found.code() < stated.code()).then_some(Misfit::Payload { stated, found });
        lacks.chain(worse).chain(payload).chain(outside.into_iter().flatten()).collect()
    }

    fn figures(&self, has: &Capability) -> [Figure; 12] {
        let [force, moment] = self.sensor_range;
        let [speed, turn] = self.max_speed;
        let period = milliseconds(self.sample_period, has.sample_period);
        let hold_after = milliseconds(self.hold_after, has.hold_after);
        let [linear, angular] =
            [0, 3].map(|first| farthest(first, &self.accommodation, &has.accommodation));
        let [linear_band, angular_band] =
            [0, 3].map(|first| farthest(first, &self.deadband, &has.deadband));
        [
            // The gain check holds for exactly this accommodation.
            Figure::new("remote.accommodation_m_per_ns", linear, Needs::Alike),
            Figure::new("remote.accommodation_rad_per_nms", angular, Needs::Alike),
            Figure::new("remote.accommodation_deadband_n", linear_band, Needs::Alike),
            Figure::new("remote.accommodation_deadband_nm", angular_band, Needs::Alike),
            Figure::new(
                "remote.servo_time_constant_s",
                [self.servo_lag, has.servo_lag],
                Needs::AtMost,
            ),
            Figure::new("remote.max_speed_m_per_s", [speed, has.max_speed[0]], Needs::AtMost),
            Figure::new("remote.max_turn_rad_per_s", [turn, has.max_speed[1]], Needs::AtMost),
            Figure::new(
                "remote.link.stiffest_contact_n_per_m",
                [self.stiffest_contact, has.stiffest_contact],
                Needs::AtMost,
            ),
            Figure::new("remote.link.sample_period_ms", period, Needs::AtMost),
            Figure::new("remote.link.hold_after_ms", hold_after, Needs::AtMost),
            Figure::new("remote.link.sensor_range_n", [force, has.sensor_range[0]], Needs::AtLeast),
            Figure::new(
                "remote.link.sensor_range_nm",
                [moment, has.sensor_range[1]],
                Needs::AtLeast,
            ),
        ]
    }
}

/// Returns the reason against a command mode that the far side does not follow.
pub fn mode_misfit(has: &Capability, mode: CommandMode) -> Option<Misfit> {
    let (follows, lacks) = match mode {
        CommandMode::Rate => (has.follows_rates, "does not follow rates"),
        CommandMode::Pose => (has.follows_poses, "does not follow poses"),
    };
    (!follows).then_some(Misfit::Lacks(lacks))
}

/// Returns each axis on which {MRF} is outside the workspace.
fn outside(has: &Capability, pose: &Pose) -> impl Iterator<Item = Misfit> {
    let [lows, highs] = has.workspace;
    let axes = ["x", "y", "z"].into_iter().zip(pose.position).zip(lows.into_iter().zip(highs));
    axes.filter_map(|((axis, position), (low, high))| {
        let is_inside = (low - WORKSPACE_MARGIN..=high + WORKSPACE_MARGIN).contains(&position);
        (!is_inside).then_some(Misfit::Outside { axis, position, low, high })
    })
}

/// Required relation of a figure to the configured one.
#[derive(Clone, Copy, Debug)]
enum Needs {
    Alike,
    AtMost,
    AtLeast,
}

/// Figure of a far side, with the configured one.
#[derive(Clone, Copy, Debug)]
struct Figure {
    key: &'static str,
    stated: f64,
    found: f64,
    needs: Needs,
}

impl Figure {
    const fn new(key: &'static str, [stated, found]: [f64; 2], needs: Needs) -> Self {
        Self { key, stated, found, needs }
    }

    fn misfit(self) -> Option<Misfit> {
        let Self { key, stated, found, needs } = self;
        // NaN is neither.
        let is_at_most = found <= stated * (1.0 + TOLERANCE);
        let is_at_least = found >= stated * (1.0 - TOLERANCE);
        let fits = match needs {
            Needs::Alike => is_at_most && is_at_least,
            Needs::AtMost => is_at_most,
            Needs::AtLeast => is_at_least,
        };
        (!fits).then_some(Misfit::Worse { key, stated, found })
    }
}

/// Returns both figures of the axis with the largest difference, among the three from `first` on.
fn farthest(first: usize, stated: &[f64; 6], found: &[f64; 6]) -> [f64; 2] {
    let pairs =
        stated.iter().zip(found).skip(first).take(3).map(|(stated, found)| [*stated, *found]);
    let apart = |[stated, found]: &[f64; 2]| (stated - found).abs();
    pairs.max_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or_default()
}

fn milliseconds(stated: f64, found: f64) -> [f64; 2] {
    [stated * 1e3, found * 1e3]
}
