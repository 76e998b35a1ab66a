//! Snapshot of one cycle: status of the node, poses, wrenches and energies.

use serde::Serialize;

use super::bus_meter::BusLoad;
use super::head::Head;
use super::pose::Pose;
use super::spans::Spans;
use super::watchdogs::Watchdog;
use crate::fidelity::command::AtGrip;
use crate::link_report::LinkReport;
use crate::losses::Losses;
use crate::recording::RecordingReport;
use crate::status::{JointLabel, Status};
use crate::timing::TimingReport;
use node::record::Record;
use remote::RobotJoints;
use units::spatial::{Motion, Wrench};

/// Snapshot of a cycle. docs/telemetry.md describes the keys besides the keys of the status.
#[derive(Debug, Serialize)]
pub(super) struct Snapshot<'a> {
    #[serde(flatten)]
    head: Head,
    at_us: u64,
    #[serde(flatten)]
    status: Status,
    sampled: [bool; 6],
    limit_used: [f64; 6],
    command: Command,
    x_0_g: Pose,
    x_0_h: Option<Pose>,
    x_b_m: Pose,
    q_r: Option<&'a [f64]>,
    f_s: [f64; 6],
    f_g: Option<[f64; 6]>,
    energy: Option<f64>,
    tank: Option<f64>,
    activity: f64,
    spans: Spans,
    buses: Vec<BusLoad>,
    sample_age_us: Option<u64>,
    watchdogs: Vec<Watchdog>,
}

/// Command to the object.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Command {
    Hold,
    Rate { v_m: [f64; 6] },
    Pose { x_b_d: Pose },
}

/// Values that change slowly, or are expensive to compute; sampled every half second.
#[derive(Clone, Debug, Default)]
pub struct Scarce {
    /// Position samples not received in time so far, over all joints.
    pub missing_samples: u64,
    /// Lost entries.
    pub lost: Losses,
    /// Parts of the session.
    pub recording: Option<RecordingReport>,
    /// Timing of the cycles so far.
    pub timing: Option<TimingReport>,
    /// Link to a robot in another process.
    pub link: Option<LinkReport>,
}

/// Values of a snapshot besides its record.
#[derive(Debug)]
pub(super) struct Beside<'a> {
    pub(super) joints: &'a [JointLabel],
    /// Maximum torque of each joint, in N·m or N.
    pub(super) max_torques: &'a [f64; 6],
    /// Number of joints of the robot; zero without one.
    pub(super) robot_joints: usize,
    pub(super) scarce: &'a Scarce,
    pub(super) spans: Spans,
    pub(super) buses: Vec<BusLoad>,
    pub(super) watchdogs: Vec<Watchdog>,
}

impl<'a> Snapshot<'a> {
    pub(super) fn new(record: &'a Record, beside: Beside<'a>) -> Self {
        let Beside { joints, max_torques, robot_joints, scarce, spans, buses, watchdogs } = beside;
        let output = &record.output;
        let status = Status::from_record(record, scarce.missing_samples, scarce.lost)
            .with_cause_named(joints);
        let status = Status {
            recording: scarce.recording.clone(),
            timing: scarce.timing.clone(),
            link: scarce.link.clone(),
            ..status
        };
        let mut limit_used = [0.0; 6];
        let torques = output.tau.iter().zip(max_torques);
        limit_used.iter_mut().zip(torques).for_each(|(used, (tau, most))| *used = tau.abs() / most);
        let is_set = output.reference.is_set;
        Self {
            head: Head::new("snapshot"),
            at_us: record.at.as_micros(),
            status,
            sampled: record.sampled,
            limit_used,
            command: Command::from_motion(&output.command),
            x_0_g: Pose::from_isometry(&output.x_0_g),
            x_0_h: is_set.then(|| Pose::from_isometry(&output.reference.x_0_h)),
            x_b_m: Pose::from_isometry(&record.x_b_m),
            q_r: record.q_r.as_ref().and_then(|q_r| robot_positions(q_r, robot_joints)),
            f_s: record.f_s.components(),
            f_g: felt(record).map(|f_g| f_g.components()),
            energy: output.port.energy,
            tank: output.port.tank,
            activity: output.port.activity,
            spans,
            buses,
            sample_age_us: record
                .sample_age
                .map(|age| u64::try_from(age.as_micros()).unwrap_or(u64::MAX)),
            watchdogs,
        }
    }
}

impl Command {
    fn from_motion(motion: &Motion) -> Self {
        match motion {
            Motion::Hold => Self::Hold,
            Motion::Rate(v_m) => Self::Rate { v_m: v_m.components() },
            Motion::Pose(x_b_d) => Self::Pose { x_b_d: Pose::from_isometry(x_b_d) },
        }
    }
}

/// Returns the positions of the robot's joints; `None` without a robot.
fn robot_positions(q_r: &RobotJoints, joints: usize) -> Option<&[f64]> {
    q_r.0.get(..joints).filter(|positions| !positions.is_empty())
}

/// Returns the wrench on the hand, at {G} in {G}, of the torques sent without gravity compensation; `None` near a
/// singularity.
fn felt(record: &Record) -> Option<Wrench> {
    let output = &record.output;
    if record.targets == [0; 6] {
        return Some(Wrench::ZERO);
    }
    AtGrip::new(&output.j_g).map(|at_grip| at_grip.wrench(&(output.tau - output.ledger.carried())))
}
