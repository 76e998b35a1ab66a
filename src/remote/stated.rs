//! Figures of a far side that the configuration states, compared with its capability before arming.

use thiserror::Error;

use contract::{Capability, PayloadRemoval, Reject, VERSION};
use robot::interaction::Interaction;
use robot::object::Servo;

/// Relative tolerance of a comparison: both ends may have rounded the same figure.
const TOLERANCE: f64 = 1e-6;

/// Figures that gains and limits are checked with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated {
    /// K_FA by axis of {MRF}, in m/(s·N) and rad/(s·N·m).
    pub accommodation: [f64; 6],
    /// Wrench by axis that K_FA does not answer, in N and N·m.
    pub deadband: [f64; 6],
    /// Maximum lag of its servos, in s.
    pub servo_lag: f64,
    /// Maximum speed of {MRF}, in m/s and rad/s.
    pub max_speed: [f64; 2],
    /// Removal of the payload from the wrench, or more.
    pub payload_removal: PayloadRemoval,
    /// Maximum stiffness of a contact, in N/m.
    pub stiffest_contact: f64,
    /// Maximum period of its cycle, in s; infinite where none is stated.
    pub sample_period: f64,
    /// Maximum age of a command that it follows, in s; infinite where none is stated.
    pub hold_after: f64,
    /// Minimum range of its sensor, in N and N·m; zero where none is stated.
    pub sensor_range: [f64; 2],
}

/// Reason why a far side does not fit the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum Misfit {
    /// No process is connected, or it does not answer.
    #[error("the far side does not answer: connect it to the link's socket")]
    Absent,
    /// Its messages are foreign to this contract or arm.
    #[error("messages of the far side have no effect: {}", foreign(*.0))]
    Foreign(Reject),
    /// Its capability has not been received.
    #[error("the far side has not said yet what it can do: try again")]
    Unknown,
    /// It follows another node.
    #[error("the far side follows another node, of session {0:016x}: stop that one first")]
    Led(u64),
    /// It has received no fresh command of any node.
    #[error("the far side follows no node: this node's commands reach it too late, or not at all")]
    Unled,
    /// Its newest sample has no wrench or no pose.
    #[error("the far side's newest sample has no valid wrench and pose: see its log")]
    Senseless,
    /// It cannot do what is needed.
    #[error("the far side {0}")]
    Lacks(&'static str),
    /// A figure is worse than stated.
    #[error("{key} is {stated}, and the far side has {found}: correct the key, or the far side")]
    Worse {
        /// Key of the configuration.
        key: &'static str,
        /// Its value.
        stated: f64,
        /// Figure of the far side.
        found: f64,
    },
    /// It removes less of the payload.
    #[error("[remote] states that the far side removes the payload's {stated}; it removes {found}")]
    Payload {
        /// Stated removal.
        stated: PayloadRemoval,
        /// Removal of the far side.
        found: PayloadRemoval,
    },
}

/// Returns the remedy for messages that are foreign to this contract or arm.
fn foreign(reject: Reject) -> String {
    if reject == Reject::Arm {
        "another arm than remote.link.arm: correct the key, or the far side".to_owned()
    } else if reject == Reject::Version {
        format!("another version of the contract than {VERSION}: update the older end")
    } else {
        format!("{reject}; docs/link.md has those that have one")
    }
}

impl Stated {
    /// Returns the figures of `[remote]`, which the far side must have alike; the others are not stated.
    pub fn of(interaction: &Interaction, servo: &Servo) -> Self {
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
            hold_after: f64::INFINITY,
            sensor_range: [0.0; 2],
        }
    }

    /// Returns the capability of a robot without a gripper that has exactly these figures, and this workspace in {b}, in m.
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

    /// Returns each figure of a capability that is worse than stated.
    pub fn misfits(&self, has: &Capability) -> Vec<Misfit> {
        let lacks = [
            (has.senses_wrench, "has no force/torque sensor"),
            (has.senses_pose, "does not measure its pose"),
            (has.follows_rates, "does not follow rates"),
            (has.follows_poses, "does not follow poses"),
        ];
        let lacks =
            lacks.into_iter().filter(|(has, _)| !has).map(|(_, reason)| Misfit::Lacks(reason));
        let worse = self.figures(has).into_iter().filter_map(Figure::misfit);
        let (stated, found) = (self.payload_removal, has.payload_removal);
        let payload = (found.code() < stated.code()).then_some(Misfit::Payload { stated, found });
        lacks.chain(worse).chain(payload).collect()
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
            // A compliance that differs either way is another loop than was checked.
            Figure::of("remote.accommodation_m_per_ns", linear, Needs::Alike),
            Figure::of("remote.accommodation_rad_per_nms", angular, Needs::Alike),
            Figure::of("remote.accommodation_deadband_n", linear_band, Needs::Alike),
            Figure::of("remote.accommodation_deadband_nm", angular_band, Needs::Alike),
            Figure::of(
                "remote.servo_time_constant_s",
                [self.servo_lag, has.servo_lag],
                Needs::AtMost,
            ),
            Figure::of("remote.max_speed_m_per_s", [speed, has.max_speed[0]], Needs::AtMost),
            Figure::of("remote.max_turn_rad_per_s", [turn, has.max_speed[1]], Needs::AtMost),
            Figure::of(
                "remote.link.stiffest_contact_n_per_m",
                [self.stiffest_contact, has.stiffest_contact],
                Needs::AtMost,
            ),
            Figure::of("remote.link.sample_period_ms", period, Needs::AtMost),
            Figure::of("remote.link.hold_after_ms", hold_after, Needs::AtMost),
            Figure::of("remote.link.sensor_range_n", [force, has.sensor_range[0]], Needs::AtLeast),
            Figure::of(
                "remote.link.sensor_range_nm",
                [moment, has.sensor_range[1]],
                Needs::AtLeast,
            ),
        ]
    }
}

/// Needed relation of a figure to the stated one.
#[derive(Clone, Copy, Debug)]
enum Needs {
    Alike,
    AtMost,
    AtLeast,
}

/// A figure of a far side, beside the stated one.
#[derive(Clone, Copy, Debug)]
struct Figure {
    key: &'static str,
    stated: f64,
    found: f64,
    needs: Needs,
}

impl Figure {
    const fn of(key: &'static str, [stated, found]: [f64; 2], needs: Needs) -> Self {
        Self { key, stated, found, needs }
    }

    fn misfit(self) -> Option<Misfit> {
        let Self { key, stated, found, needs } = self;
        let is_above = found > stated * (1.0 + TOLERANCE);
        let is_below = found < stated * (1.0 - TOLERANCE);
        let is_worse = match needs {
            Needs::Alike => is_above || is_below,
            Needs::AtMost => is_above,
            Needs::AtLeast => is_below,
        };
        is_worse.then_some(Misfit::Worse { key, stated, found })
    }
}

/// Returns the stated and the found figure of that axis of three, from the `first` on, at which they differ most.
fn farthest(first: usize, stated: &[f64; 6], found: &[f64; 6]) -> [f64; 2] {
    let pairs =
        stated.iter().zip(found).skip(first).take(3).map(|(stated, found)| [*stated, *found]);
    let apart = |[stated, found]: &[f64; 2]| (stated - found).abs();
    pairs.max_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or_default()
}

fn milliseconds(stated: f64, found: f64) -> [f64; 2] {
    [stated * 1e3, found * 1e3]
}
