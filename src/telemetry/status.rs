//! How the node is right now, as `frhc ctl status` tells it.

use serde::Serialize;

use crate::telemetry::record::Record;

/// A snapshot of the node.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// The mode, in one word.
    pub mode: &'static str,
    /// What stopped the node, while it is stopped.
    pub stopped_by: Option<String>,
    /// Cycles run.
    pub cycle: u64,
    /// Samples missed so far.
    pub missing_samples: u64,
    /// Joint positions, in rad (m for a prismatic joint).
    pub q: [f64; 6],
    /// Torques commanded to the joints, in N·m.
    pub tau: [f64; 6],
    /// Target torques sent, in per mille of rated torque.
    pub targets: [i16; 6],
    /// The wrench felt at the grip: force in N, moment in N·m.
    pub f_g_task: [f64; 6],
    /// Place of the object in its base, in m.
    pub p_b_m: [f64; 3],
    /// Whether the switch box is heard.
    pub switches_heard: bool,
}

impl Status {
    /// Of the newest record, with the number of samples missed so far.
    pub fn of(record: &Record, missing_samples: u64) -> Self {
        let p_b_m = record.x_b_m.translation.vector;
        Self {
            mode: record.mode.name(),
            stopped_by: record.cause.map(|cause| cause.to_string()),
            cycle: record.cycle,
            missing_samples,
            q: record.output.q.into(),
            tau: record.output.tau.into(),
            targets: record.targets,
            f_g_task: record.output.f_g_task.components(),
            p_b_m: [p_b_m.x, p_b_m.y, p_b_m.z],
            switches_heard: record.inputs.is_some(),
        }
    }
}
