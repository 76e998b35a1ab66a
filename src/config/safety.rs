//! `[safety]`: time limits, ramps and the drives' own timers. `plausibility` has the bounds of samples.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::value::Placed;

/// Time limits of faults before torque goes off, and ramps.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    /// Timeout of a drive without a fresh RPDO; 0 if only the heartbeat stops it.
    pub rpdo_timer_ms: u16,
    /// Timeout of a drive without the master's heartbeat.
    pub node_lost_ms: u16,
    /// Heartbeat period of the drives.
    pub drive_heartbeat_ms: u16,
    /// Timeout of the master without a node's heartbeat.
    pub drive_lost: Duration,
    /// Cycles in a row without a sample of a joint that are a fault.
    pub missing_samples: u32,
    /// Ramp of gravity compensation from zero to full.
    pub gravity_ramp: Duration,
    /// Ramp of reflection from zero to full.
    pub reflection_ramp: Duration,
    /// Time from the first controlword until all drives are enabled.
    pub enable_timeout: Duration,
    /// Protection by the drives themselves.
    pub protection: Protection,
}

/// Protection by the drives themselves.
#[derive(Clone, Copy, Debug)]
pub struct Protection {
    /// Requires a proof test of every drive's timers at every boot.
    pub proves_drives: bool,
    /// Mass of hand and grip, in kg.
    pub effective_mass: f64,
}

/// Usual `safety.enable_ms`.
const ENABLE_MS: u32 = 2_000;

/// Reads the time limits and checks them against the period. Returns `None` after a problem.
pub(super) fn read(
    raw: &raw::File,
    period: Option<Duration>,
    problems: &mut Problems<'_>,
) -> Option<Safety> {
    let safety = &raw.safety;
    rpdo_timer(safety, period, problems);
    node_heartbeat(raw, period, problems);
    drive_heartbeat(safety, problems);
    problems.within(&safety.missing_samples, 1..=20);
    let gravity = problems.within(&safety.gravity_ramp_s, 0.01..=60.0);
    let reflection = problems.within(&safety.reflection_ramp_s, 0.01..=60.0);
    let enable_ms = problems.within(&safety.enable_ms.or(ENABLE_MS), 100..=60_000);
    let protection = protection(safety, problems);
    Some(Safety {
        rpdo_timer_ms: safety.rpdo_timer_ms.get()?,
        node_lost_ms: safety.node_lost_ms.get()?,
        drive_heartbeat_ms: safety.drive_heartbeat_ms.get()?,
        drive_lost: millis(safety.drive_lost_ms.get()?),
        missing_samples: safety.missing_samples.get()?,
        gravity_ramp: Duration::try_from_secs_f64(gravity?).unwrap_or_default(),
        reflection_ramp: Duration::try_from_secs_f64(reflection?).unwrap_or_default(),
        enable_timeout: Duration::from_millis(enable_ms?.into()),
        protection: protection?,
    })
}

fn millis(millis: u16) -> Duration {
    Duration::from_millis(u64::from(millis))
}

/// A drive's RPDO timer must outlast a SYNC that is late.
fn rpdo_timer(safety: &raw::Safety, period: Option<Duration>, problems: &mut Problems<'_>) {
    let Some((timer, period)) = safety.rpdo_timer_ms.get().zip(period) else { return };
    if timer > 0 && millis(timer) < period * 2 {
        let two = (period * 2).as_micros();
        let reason = format!("{timer} ms is less than two periods, {two} µs");
        problems.add(&safety.rpdo_timer_ms, reason);
    }
}

/// The node's heartbeat leaves with a cycle, so with no shorter interval, and with whole ones.
fn node_heartbeat(raw: &raw::File, period: Option<Duration>, problems: &mut Problems<'_>) {
    let (given, lost_ms) = (&raw.node.heartbeat_ms, &raw.safety.node_lost_ms);
    let Some((heartbeat_ms, period)) = given.get().zip(period) else { return };
    let (heartbeat, cycle) = (millis(heartbeat_ms), period.as_micros());
    if heartbeat < period {
        let key = raw.node.sync_period_us.place().key();
        let reason = format!(
            "must be at least the cycle that sends it, {cycle} µs ({key}), got {heartbeat_ms} ms"
        );
        problems.add(given, reason);
    }
    let Some(lost) = lost_ms.get() else { return };
    let cycles = heartbeat.as_micros().div_ceil(cycle.max(1)).max(1);
    let interval = period * u32::try_from(cycles).unwrap_or(u32::MAX);
    if millis(lost) < interval * 2 {
        let (two, key) = ((interval * 2).as_micros(), given.place().key());
        let reason = format!(
            "must be at least two of the node's heartbeats, which leave every {cycles} cycles: {two} µs, \
             got {lost} ms; see {key}"
        );
        problems.add(lost_ms, reason);
    }
}

/// Checks that a drive counts as lost only after its second heartbeat is due.
fn drive_heartbeat(safety: &raw::Safety, problems: &mut Problems<'_>) {
    let (given, lost_ms) = (&safety.drive_heartbeat_ms, &safety.drive_lost_ms);
    if lost_ms.get().zip(given.get()).is_some_and(|(lost, beat)| lost < beat.saturating_mul(2)) {
        let key = given.place().key();
        problems.add(lost_ms, format_args!("is less than two of the drives' heartbeats ({key})"));
    }
    problems.within(given, 1..=10_000);
}

/// Reads the protection by the drives themselves.
fn protection(raw: &raw::Safety, problems: &mut Problems<'_>) -> Option<Protection> {
    let effective_mass = problems.within(&raw.effective_mass_kg.or(1.0), 0.1..=3.0);
    let proves_drives = raw.prove_drives.or(true).get()?;
    Some(Protection { proves_drives, effective_mass: effective_mass? })
}
