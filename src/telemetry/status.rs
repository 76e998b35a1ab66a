//! Status of the node, for `frhc ctl status`.

use serde::Serialize;

use crate::gripper_status::GripperStatus;
use crate::hold_status::HoldStatus;
use crate::link_report::LinkReport;
use crate::losses::Losses;
use crate::recording::RecordingReport;
use crate::timing::TimingReport;
use crate::trial_status::TrialReport;
use config::zeroing::Zeroing;
use config::{Config, JointParameters};
use controller::Ledger;
use controller::adjustment::AdjustmentState;
use controller::arm::JointKind;
use controller::scaling::Scale;
use node::cause;
use node::record::{Mode, Record};
use node::zero::ZeroState;
use remote::model::Difference;
use units::drive::Counts;
use units::numbering::Joint;

/// Status of the node in one cycle.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// Mode of the node: `armed`, `engaged`, …
    pub mode: &'static str,
    /// Cause of the stop, while stopped.
    pub stopped_by: Option<String>,
    /// Joints whose drives have not confirmed power off after "disable voltage". Do not touch the arm.
    pub not_off: Vec<u8>,
    /// Steps that lead on from the mode, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub way_out: Vec<String>,
    /// Cycles run.
    pub cycle: u64,
    /// Cycles whose torques were too late to be sent, or whose SYNC was skipped.
    pub overruns: u64,
    /// Position samples not received in time so far, over all joints.
    pub missing_samples: u64,
    /// Frames, records and events lost before the disk.
    pub lost: Losses,
    /// Parts of the recorded session, and the reason of an early end; `None` without a recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingReport>,
    /// SDO uploads of other clients.
    pub foreign_uploads: u32,
    /// Number of objects verified at boot that currently cannot be read back.
    pub unread_settings: u32,
    /// Reflection of the wrench: `off` and `on` by its switch; `on when engaged` before it acts.
    pub reflection: &'static str,
    /// Scales of motion, rotation and force that the operator set.
    pub scale: Scale,
    /// Axes of the command that the operator locked: `x`, `rz`.
    pub locked: Vec<String>,
    /// Set while the object is being aligned with the orientation of the grip.
    pub aligning: bool,
    /// Actual positions (6064h), in counts.
    #[serde(skip)]
    pub counts: [Counts; 6],
    /// Joints with their names and units; empty if these are unknown.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<JointStatus>,
    /// Joints whose zero is unknown, which forbids arming.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub zero_unknown: Vec<UnknownZeroReport>,
    /// Joint positions, in rad (m for a prismatic joint); NaN, `null` in JSON, if the zero is unknown.
    pub q: [f64; 6],
    /// Torques commanded to the joints, in N·m.
    pub tau: [f64; 6],
    /// Target torques sent, in per mille of rated torque.
    pub targets: [i16; 6],
    /// Components of these torques.
    pub budget: Ledger,
    /// Motion of the arm by itself; `None` unless measuring.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hold: Option<HoldStatus>,
    /// Newest trial of one drive since the last boot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trial: Option<TrialReport>,
    /// Reflected wrench at the grip: force in N, moment in N·m.
    pub f_g_task: [f64; 6],
    /// Position of the object in its base, in m.
    pub p_b_m: [f64; 3],
    /// Difference between robot and model; `None` without a model or a sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelDifference>,
    /// Gripper; `None` if the switch box has no input for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gripper: Option<GripperStatus>,
    /// Set if the inputs of the switch box are fresh; `None` without a switch box, which arming requires.
    pub switches_online: Option<bool>,
    /// Timing of the cycles, boot included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timing: Option<TimingReport>,
    /// Link to a robot in another process; `None` if the commanded side is in this process.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkReport>,
}

/// Name of a joint, and its kind, which decides its units.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointLabel {
    /// Displayed name.
    pub name: String,
    /// Set for a prismatic joint, with m and N instead of rad and N·m.
    pub is_prismatic: bool,
}

impl JointLabel {
    /// Returns name and kind of a joint.
    pub fn from_parameters(joint: &JointParameters) -> Self {
        let is_prismatic = joint.plant.link.kind == JointKind::Prismatic;
        Self { name: joint.name.clone(), is_prismatic }
    }

    /// Returns the units of position and torque.
    pub const fn units(&self) -> [&'static str; 2] {
        if self.is_prismatic { ["m", "N"] } else { ["rad", "N·m"] }
    }
}

/// Returns names and units of the joints of a configuration, base first.
pub fn labels(config: &Config) -> Vec<JointLabel> {
    config.joints.iter().map(JointLabel::from_parameters).collect()
}

/// Difference between predicted and sensed pose of a robot.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct ModelDifference {
    /// Distance between the positions, in mm.
    pub distance_mm: f64,
    /// Angle of the rotation between the orientations, in degrees.
    pub angle_deg: f64,
}

impl ModelDifference {
    /// Converts a difference to mm and degrees.
    pub(crate) fn new(Difference { distance, angle }: Difference) -> Self {
        Self { distance_mm: distance * 1e3, angle_deg: angle.to_degrees() }
    }

    /// Returns the larger distance and the larger angle of two differences.
    pub(crate) const fn max(self, other: Self) -> Self {
        Self {
            distance_mm: self.distance_mm.max(other.distance_mm),
            angle_deg: self.angle_deg.max(other.angle_deg),
        }
    }
}

/// Joint whose zero is unknown, and why.
#[derive(Clone, Debug, Serialize)]
pub struct UnknownZeroReport {
    /// Number, from 1 at the base.
    pub joint: u8,
    /// Reason in words.
    pub why: String,
}

/// Position and torque of one joint, with their units.
#[derive(Clone, Debug, Serialize)]
pub struct JointStatus {
    /// Number, from 1 at the base.
    pub joint: u8,
    /// Displayed name.
    pub name: String,
    /// Position, in `position_unit`; NaN, `null` in JSON, if the zero is unknown.
    pub position: f64,
    /// `rad` or `m`.
    pub position_unit: &'static str,
    /// Torque commanded, in `torque_unit`.
    pub torque: f64,
    /// `N·m` or `N`.
    pub torque_unit: &'static str,
    /// Target torque sent (6071h), in ‰ of rated torque.
    pub target_per_mille: i16,
    /// Actual position (6064h), in counts.
    pub counts: i32,
    /// `known`, or `unknown`.
    pub zero: &'static str,
    /// Position that `frhc ctl zero` would give these counts, in `position_unit`; `None` if it sets nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub if_zeroed: Option<f64>,
}

impl Status {
    /// Creates the status from the newest record, and the numbers of missed samples and lost entries.
    pub fn from_record(record: &Record, missing_samples: u64, lost: Losses) -> Self {
        let p_b_m = record.x_b_m.translation.vector;
        Self {
            mode: record.mode.name(),
            stopped_by: record.cause.map(|cause| cause.to_string()),
            not_off: joints(&record.not_off),
            way_out: Vec::new(),
            cycle: record.cycle,
            overruns: record.overruns,
            missing_samples,
            lost,
            recording: None,
            foreign_uploads: record.sdo.foreign_uploads,
            unread_settings: record.sdo.unread_settings,
            reflection: reflection(record),
            scale: record.output.adjusted.scale,
            locked: locked(&record.output.adjusted),
            aligning: record.output.adjusted.is_aligning,
            joints: Vec::new(),
            counts: record.counts,
            zero_unknown: unknown_zeros(record),
            q: known_positions(record),
            tau: record.output.tau.into(),
            targets: record.targets,
            budget: record.output.ledger,
            hold: record.output.hold.as_ref().map(HoldStatus::new),
            trial: record.trial.as_ref().map(TrialReport::new),
            f_g_task: record.output.f_g_task.components(),
            p_b_m: [p_b_m.x, p_b_m.y, p_b_m.z],
            model: record.model.map(ModelDifference::new),
            gripper: record.gripper.map(GripperStatus::from_record),
            switches_online: record.has_switch_box.then_some(record.inputs.is_some()),
            timing: None,
            link: None,
        }
    }

    /// Adds the joint's name to the cause. `labels` names the joints, base first.
    #[must_use]
    pub fn with_cause_named(mut self, labels: &[JointLabel]) -> Self {
        let names: Vec<_> = labels.iter().map(|label| label.name.as_str()).collect();
        self.stopped_by = self.stopped_by.map(|text| cause::with_name(&text, &names));
        self
    }

    /// Adds the joints with names and units of `labels`, base first.
    #[must_use]
    pub fn with_joints(self, labels: &[JointLabel]) -> Self {
        let mut named = self.with_cause_named(labels);
        named.joints = named.joint_statuses(labels);
        named
    }

    /// Adds the position that each joint would have if its zero were set now.
    #[must_use]
    pub fn with_zeroing(mut self, zeroing: &Zeroing) -> Self {
        let if_zeroed = zeroing.if_zeroed(&self.counts);
        for (status, (_, position)) in self.joints.iter_mut().zip(Joint::each(if_zeroed)) {
            status.if_zeroed = position;
        }
        self
    }

    fn joint_statuses(&self, labels: &[JointLabel]) -> Vec<JointStatus> {
        let values = self.q.into_iter().zip(self.tau).zip(self.targets).zip(self.counts);
        let joints = Joint::each(labels).zip(values);
        let is_unknown =
            |joint: Joint| self.zero_unknown.iter().any(|it| it.joint == joint.number());
        let joint = |((joint, label), (((position, torque), target), Counts(counts))): (
            (Joint, &JointLabel),
            _,
        )| {
            let [position_unit, torque_unit] = label.units();
            JointStatus {
                joint: joint.number(),
                name: label.name.clone(),
                position,
                position_unit,
                torque,
                torque_unit,
                target_per_mille: target,
                counts,
                zero: if is_unknown(joint) { "unknown" } else { "known" },
                if_zeroed: None,
            }
        };
        joints.map(joint).collect()
    }
}

fn unknown_zeros(record: &Record) -> Vec<UnknownZeroReport> {
    let report = |(joint, state): (Joint, ZeroState)| match state {
        ZeroState::Known => None,
        ZeroState::Unknown(why) => {
            Some(UnknownZeroReport { joint: joint.number(), why: why.to_string() })
        }
    };
    Joint::each(record.zeros).filter_map(report).collect()
}

/// Returns the joint positions, NaN for those whose zero is unknown.
fn known_positions(record: &Record) -> [f64; 6] {
    let mut q: [f64; 6] = record.output.q.into();
    for (q, state) in q.iter_mut().zip(record.zeros) {
        if state != ZeroState::Known {
            *q = f64::NAN;
        }
    }
    q
}

/// Returns the state of reflection, by its switch and the deadman.
fn reflection(record: &Record) -> &'static str {
    let permissions = record.output.permissions;
    match (permissions.reflects, permissions.task && record.mode == Mode::Engaged) {
        (false, _) => "off",
        (true, false) => "on when engaged",
        (true, true) => "on",
    }
}

fn locked(adjusted: &AdjustmentState) -> Vec<String> {
    adjusted.locked_axes().map(|axis| axis.to_string()).collect()
}

/// Returns the numbers of the joints that are set.
pub fn joints(set: &[bool; 6]) -> Vec<u8> {
    Joint::each(set).filter(|(_, is_set)| **is_set).map(|(joint, _)| joint.number()).collect()
}
