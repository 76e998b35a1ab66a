//! Status of the node, for `frhc ctl status`.

use serde::Serialize;

use crate::losses::Losses;
use controller::Ledger;
use node::record::Record;
use units::numbering::Joint;

/// A snapshot of the node.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// Mode.
    pub mode: &'static str,
    /// Cause of the stop, while stopped.
    pub stopped_by: Option<String>,
    /// Cycles run.
    pub cycle: u64,
    /// Cycles over time: torques too late to be sent, or a skipped SYNC.
    pub overruns: u64,
    /// Missed samples.
    pub missing_samples: u64,
    /// Frames, records and events lost before the disk.
    pub lost: Losses,
    /// SDO uploads of other clients.
    pub foreign_uploads: u64,
    /// Objects verified at boot that could not be read again, at present.
    pub unread_settings: usize,
    /// Joint positions, in rad (m for a prismatic joint).
    pub q: [f64; 6],
    /// Torques commanded to the joints, in N·m.
    pub tau: [f64; 6],
    /// Target torques sent, in per mille of rated torque.
    pub targets: [i16; 6],
    /// Components of these torques.
    pub budget: Budget,
    /// Reflected wrench at the grip: force in N, moment in N·m.
    pub f_g_task: [f64; 6],
    /// Position of the object in its base, in m.
    pub p_b_m: [f64; 3],
    /// Inputs of the switch box are up to date; `None` if none is configured, so that nothing can be armed.
    pub switches_online: Option<bool>,
}

/// Torque budget of the newest cycle, in N·m or N; joints count from 1.
#[derive(Clone, Debug, Serialize)]
pub struct Budget {
    /// Reflected wrench.
    pub task: [f64; 6],
    /// Gravity compensation.
    pub gravity: [f64; 6],
    /// Return to centre, before scaling.
    pub centring: [f64; 6],
    /// Damping, before scaling.
    pub damping: [f64; 6],
    /// Passivity layer.
    pub passivity: [f64; 6],
    /// Soft stops.
    pub soft_stops: [f64; 6],
    /// Friction compensation.
    pub friction: [f64; 6],
    /// Scale of return to centre and damping.
    pub assist_scale: f64,
    /// Scale of reflected wrench and assist.
    pub rest_scale: f64,
    /// Joint that limits the scale.
    pub limiting_joint: Option<u8>,
    /// Joint at its slew rate limit.
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
            friction: ledger.friction.into(),
            assist_scale: ledger.assist_scale,
            rest_scale: ledger.rest_scale,
            limiting_joint: ledger.limiting_joint.map(Joint::number),
            slewing_joint: ledger.slewing_joint.map(Joint::number),
        }
    }
}

impl Status {
    /// Creates the status from the newest record, and the numbers of missed samples and lost entries.
    pub fn of(record: &Record, missing_samples: u64, lost: Losses) -> Self {
        let p_b_m = record.x_b_m.translation.vector;
        Self {
            mode: record.mode.name(),
            stopped_by: record.cause.map(|cause| cause.to_string()),
            cycle: record.cycle,
            overruns: record.overruns,
            missing_samples,
            lost,
            foreign_uploads: record.sdo.foreign_uploads,
            unread_settings: record.sdo.unread_settings,
            q: record.output.q.into(),
            tau: record.output.tau.into(),
            targets: record.targets,
            budget: Budget::from(&record.output.ledger),
            f_g_task: record.output.f_g_task.components(),
            p_b_m: [p_b_m.x, p_b_m.y, p_b_m.z],
            switches_online: record.has_switch_box.then_some(record.inputs.is_some()),
        }
    }
}
