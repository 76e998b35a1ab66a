//! How the node is right now, as `frhc ctl status` tells it.

use serde::Serialize;

use crate::losses::Losses;
use controller::Ledger;
use node::record::Record;
use units::numbering::Joint;

/// A snapshot of the node.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// The mode, in one word.
    pub mode: &'static str,
    /// What stopped the node, while it is stopped.
    pub stopped_by: Option<String>,
    /// Cycles run.
    pub cycle: u64,
    /// Cycles so far that took longer than they may: torques too late to be sent, or a SYNC that was skipped.
    pub overruns: u64,
    /// Samples missed so far.
    pub missing_samples: u64,
    /// Frames, records and events lost on the way to the disk so far.
    pub lost: Losses,
    /// SDO uploads that other clients have begun so far.
    pub foreign_uploads: u64,
    /// Objects that the boot has proven and that could not be read again, at this moment.
    pub unread_settings: usize,
    /// Joint positions, in rad (m for a prismatic joint).
    pub q: [f64; 6],
    /// Torques commanded to the joints, in N·m.
    pub tau: [f64; 6],
    /// Target torques sent, in per mille of rated torque.
    pub targets: [i16; 6],
    /// What those torques are made of.
    pub budget: Budget,
    /// The wrench felt at the grip: force in N, moment in N·m.
    pub f_g_task: [f64; 6],
    /// Place of the object in its base, in m.
    pub p_b_m: [f64; 3],
    /// Whether the switch box is heard.
    pub switches_heard: bool,
}

/// The torque budget of the newest cycle, in N·m or N; joints count from 1.
#[derive(Clone, Debug, Serialize)]
pub struct Budget {
    /// Of the task.
    pub task: [f64; 6],
    /// Carrying the arm.
    pub gravity: [f64; 6],
    /// Of the return to centre, before its scaling.
    pub centring: [f64; 6],
    /// Of damping, before its scaling.
    pub damping: [f64; 6],
    /// Keeping contact passive.
    pub passivity: [f64; 6],
    /// Of the soft stops.
    pub soft_stops: [f64; 6],
    /// What is left of return to centre and damping.
    pub assist_scale: f64,
    /// What is left of task and assist.
    pub rest_scale: f64,
    /// The joint that left no more.
    pub limiting_joint: Option<u8>,
    /// The joint that could not change as fast as asked.
    pub slewing_joint: Option<u8>,
}

impl From<&Ledger> for Budget {
    fn from(ledger: &Ledger) -> Self {
        Self {
            task: ledger.task.into(),
            gravity: ledger.gravity.into(),
            centring: ledger.centring.into(),
            damping: ledger.damping.into(),
            passivity: ledger.passivity.into(),
            soft_stops: ledger.soft_stops.into(),
            assist_scale: ledger.assist_scale,
            rest_scale: ledger.rest_scale,
            limiting_joint: ledger.limiting_joint.map(Joint::number),
            slewing_joint: ledger.slewing_joint.map(Joint::number),
        }
    }
}

impl Status {
    /// Of the newest record, with the numbers of samples missed and of entries lost so far.
    pub fn of(record: &Record, missing_samples: u64, lost: Losses) -> Self {
        let p_b_m = record.x_b_m.translation.vector;
        Self {
            mode: record.mode.name(),
            stopped_by: record.cause.map(|cause| cause.to_string()),
            cycle: record.cycle,
            overruns: record.overruns,
            missing_samples,
            lost,
            foreign_uploads: record.others.uploads,
            unread_settings: record.others.unread,
            q: record.output.q.into(),
            tau: record.output.tau.into(),
            targets: record.targets,
            budget: Budget::from(&record.output.ledger),
            f_g_task: record.output.f_g_task.components(),
            p_b_m: [p_b_m.x, p_b_m.y, p_b_m.z],
            switches_heard: record.inputs.is_some(),
        }
    }
}
