//! `[safety]`, as far as it is about time and about the drives by themselves; what of it is about samples stands
//! in `plausibility`.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;

/// How long what may last before torque goes off.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    /// A drive without a fresh RPDO; 0 where only the heartbeat is to stop it.
    pub rpdo_timer_ms: u16,
    /// A drive without the master's heartbeat.
    pub node_lost_ms: u16,
    /// How often drives send their heartbeat.
    pub drive_heartbeat_ms: u16,
    /// The master without a node's heartbeat.
    pub drive_lost: Duration,
    /// Cycles in a row without a joint's sample.
    pub missing_samples: u32,
    /// Gravity compensation from zero to full.
    pub gravity_ramp: Duration,
    /// Reflection from zero to full.
    pub reflection_ramp: Duration,
    /// What the drives do by themselves.
    pub protection: Protection,
}

/// `[safety]`, as far as it is about the drives by themselves.
#[derive(Clone, Copy, Debug)]
pub struct Protection {
    /// Whether every drive must show at every boot that it stops by itself.
    pub proves_drives: bool,
    /// Of hand and grip, in kg.
    pub effective_mass: f64,
}

/// Limits in time, and whether they can hold at this period.
pub(super) fn read(raw: &raw::File, period: Duration, problems: &mut Problems<'_>) -> Safety {
    let safety = &raw.safety;
    let millis = |millis: u16| Duration::from_millis(u64::from(millis));
    if safety.rpdo_timer_ms > 0 && millis(safety.rpdo_timer_ms) < period * 2 {
        let two = (period * 2).as_micros();
        let reason = format!("{} ms is less than two periods, {two} µs", safety.rpdo_timer_ms);
        problems.add("safety.rpdo_timer_ms", reason);
    }
    node_heartbeat(raw, period, problems);
    if safety.drive_lost_ms < safety.drive_heartbeat_ms.saturating_mul(2) {
        let reason = "is less than two of the drives' heartbeats (safety.drive_heartbeat_ms)";
        problems.add("safety.drive_lost_ms", reason);
    }
    problems.within("safety.drive_heartbeat_ms", safety.drive_heartbeat_ms, 1..=10_000);
    problems.within("safety.missing_samples", safety.missing_samples, 1..=20);
    let gravity = problems.within("safety.gravity_ramp_s", safety.gravity_ramp_s, 0.01..=60.0);
    let reflection =
        problems.within("safety.reflection_ramp_s", safety.reflection_ramp_s, 0.01..=60.0);
    Safety {
        rpdo_timer_ms: safety.rpdo_timer_ms,
        node_lost_ms: safety.node_lost_ms,
        drive_heartbeat_ms: safety.drive_heartbeat_ms,
        drive_lost: millis(safety.drive_lost_ms),
        missing_samples: safety.missing_samples,
        gravity_ramp: Duration::try_from_secs_f64(gravity).unwrap_or_default(),
        reflection_ramp: Duration::try_from_secs_f64(reflection).unwrap_or_default(),
        protection: protection(safety, problems),
    }
}

/// The node's heartbeat leaves with a cycle, so with no shorter interval, and with whole ones.
fn node_heartbeat(raw: &raw::File, period: Duration, problems: &mut Problems<'_>) {
    let heartbeat = Duration::from_millis(u64::from(raw.node.heartbeat_ms));
    let lost = Duration::from_millis(u64::from(raw.safety.node_lost_ms));
    if heartbeat < period {
        let (heartbeat, cycle) = (raw.node.heartbeat_ms, period.as_micros());
        let reason = format!(
            "must be at least the cycle that sends it, {cycle} µs (node.sync_period_us), got {heartbeat} ms"
        );
        problems.add("node.heartbeat_ms", reason);
    }
    let cycles = heartbeat.as_micros().div_ceil(period.as_micros().max(1)).max(1);
    let interval = period * u32::try_from(cycles).unwrap_or(u32::MAX);
    if lost < interval * 2 {
        let (two, got) = ((interval * 2).as_micros(), raw.safety.node_lost_ms);
        let reason = format!(
            "must be at least two of the node's heartbeats, which leave every {cycles} cycles: {two} µs, \
             got {got} ms; see node.heartbeat_ms"
        );
        problems.add("safety.node_lost_ms", reason);
    }
}

/// Of the drives by themselves.
fn protection(raw: &raw::Safety, problems: &mut Problems<'_>) -> Protection {
    let mass = problems.within("safety.effective_mass_kg", raw.effective_mass_kg, 0.1..=3.0);
    Protection { proves_drives: raw.prove_drives, effective_mass: mass }
}
