//! `[safety]`: time limits, ramps and the drives' own timers. `plausibility` has the bounds of samples.

use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::value::HasPlace;

/// Time limits of faults until torque is switched off, and ramps.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    /// RPDO event timer of the drives (1400h:5), in ms; 0 to disable it.
    pub rpdo_timer_ms: u16,
    /// Consumer heartbeat time of the drives for the master (1016h), in ms.
    pub node_lost_ms: u16,
    /// Producer heartbeat time of the drives (1017h), in ms.
    pub drive_heartbeat_ms: u16,
    /// Consumer heartbeat time of the master for each node.
    pub drive_lost: Duration,
    /// Number of consecutive cycles without a sample of a joint that is a fault.
    pub missing_samples: u32,
    /// Duration of the ramp of gravity compensation from zero to full.
    pub gravity_ramp: Duration,
    /// Duration of the ramp of reflection from zero to full.
    pub reflection_ramp: Duration,
    /// Maximum time from the first controlword until all drives are in Operation enabled.
    pub enable_timeout: Duration,
    /// Settings of the drives' own protection.
    pub protection: Protection,
}

/// Protection of the hand by the drives' own timers.
#[derive(Clone, Copy, Debug)]
pub struct Protection {
    /// Set if every boot includes a proof test of every drive's timers.
    pub proves_drives: bool,
    /// Mass of hand and grip, in kg.
    pub effective_mass: f64,
}

/// Default of `safety.enable_ms`.
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

/// Checks that the RPDO timer is at least two periods, so that it tolerates a late SYNC.
fn rpdo_timer(safety: &raw::Safety, period: Option<Duration>, problems: &mut Problems<'_>) {
    let Some((timer, period)) = safety.rpdo_timer_ms.get().zip(period) else { return };
    if timer > 0 && millis(timer) < period * 2 {
        let two = (period * 2).as_micros();
        let reason = format!("{timer} ms is less than two periods, {two} µs");
        problems.add(&safety.rpdo_timer_ms, reason);
    }
}

/// Checks the master's heartbeat period and the drives' consumer time for it. Cycles send the heartbeat, so its interval
/// is a multiple of the period.
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

/// Checks that the consumer time for a drive is at least two of its heartbeat periods.
fn drive_heartbeat(safety: &raw::Safety, problems: &mut Problems<'_>) {
    let (given, lost_ms) = (&safety.drive_heartbeat_ms, &safety.drive_lost_ms);
    if lost_ms.get().zip(given.get()).is_some_and(|(lost, beat)| lost < beat.saturating_mul(2)) {
        let key = given.place().key();
        problems.add(lost_ms, format_args!("is less than two of the drives' heartbeats ({key})"));
    }
    problems.within(given, 1..=10_000);
}

/// Reads the settings of the drives' own protection.
fn protection(raw: &raw::Safety, problems: &mut Problems<'_>) -> Option<Protection> {
    let effective_mass = problems.within(&raw.effective_mass_kg.or(1.0), 0.1..=3.0);
    let proves_drives = raw.prove_drives.or(true).get()?;
    Some(Protection { proves_drives, effective_mass: effective_mass? })
}
