//! Measurements of a case after every cycle: node, bus, drives and grip.

use std::time::Duration;

use nalgebra::Vector3;

use crate::expectation::EndState;
use crate::injection::Injection;
use crate::monitor::{Monitor, is_off};
use crate::timers;
use crate::verdict::Observation;
use config::Config;
use faults::{Disturbance, Fault, FaultKind};
use inputs::InputSink;
use node::record::{Mode, Record};
use sim::drive::Drive;
use testbench::bench::Bench;
use units::time::Instant;

/// Duration of the measurement of the grip's speed and displacement after the onset.
const GRIP_MEASURED: Duration = Duration::from_millis(100);

/// Time between zero torque and the drives' power off (S2).
const OFF_AFTER: Duration = Duration::from_millis(100);

/// Tolerance of [`OFF_AFTER`]: controlwords are sent one at a time, and act at the drive's next SYNC.
const OFF_TOLERANCE: Duration = Duration::from_millis(15);

/// Minimum reflected torque that counts, as a share of a joint's capacity.
const MIN_FELT: f64 = 0.02;

/// Measures node, bus and arm after every cycle.
#[derive(Debug)]
pub(super) struct Observer {
    before: Instant,
    start: Vector3<f64>,
    /// Position of the grip, and the time of the arm.
    last: (Instant, Vector3<f64>),
    /// Speed of the grip in the last two cycles, the newest first, in m/s.
    speeds: [f64; 2],
    felt_until: Option<Instant>,
    detected: Option<Instant>,
    power: PowerStages,
    drives_off: Option<Instant>,
    observed: Observation,
}

impl Observer {
    /// Starts with the present state of the bench; power stages may be on for `off_tolerance` after "drives off".
    pub(super) fn new<S: InputSink + Clone>(
        bench: &Bench<Monitor, S>,
        off_tolerance: Duration,
    ) -> Self {
        let grip = grip(bench);
        Self {
            before: bench.now(),
            start: grip,
            last: (bench.node().bus().stations().now(), grip),
            speeds: [0.0; 2],
            felt_until: None,
            detected: None,
            power: PowerStages::new(off_tolerance),
            drives_off: None,
            observed: Observation::default(),
        }
    }

    /// Returns whether the node was latched since the onset.
    pub(super) const fn is_latched(&self) -> bool {
        self.detected.is_some()
    }

    /// Returns whether the grip was faster than `limit`, in m/s, in each of the last two cycles.
    pub(super) fn is_faster(&self, limit: f64) -> bool {
        self.speeds.iter().all(|speed| *speed > limit)
    }

    /// Takes a cycle.
    pub(super) fn update<S: InputSink + Clone>(
        &mut self,
        bench: &Bench<Monitor, S>,
        config: &Config,
        onset: Instant,
        record: &Record,
    ) {
        let (now, grip) = (bench.now(), grip(bench));
        let dt = now.since(self.before.max(onset)).as_secs_f64();
        if now < onset {
            self.start = grip;
        } else {
            let world = bench.node().bus().stations();
            self.observed.impulse += world.torques().abs().sum() * dt;
            self.observed.peak = self.observed.peak.max(bench.node().bus().tap().peak());
            let monitor = bench.node().bus().tap();
            let drives = world.drives().iter().zip(monitor.acting_ages());
            for (_, age) in drives.filter(|(drive, _)| drive.demand().abs() > 0.0) {
                self.observed.applied += u64::from(monitor.is_stale(age));
                self.observed.oldest = self.observed.oldest.max(age);
            }
            // Cycles end at uneven times; the arm advances to each SYNC.
            let moved_for = world.now().since(self.last.0).as_secs_f64();
            if now.since(onset) <= GRIP_MEASURED && moved_for > 0.0 {
                let speed = (grip - self.last.1).norm() / moved_for;
                self.observed.speed = self.observed.speed.max(speed);
                self.speeds = [speed, self.speeds[0]];
                self.observed.travel = self.observed.travel.max((grip - self.start).norm());
            }
            if is_reflecting(config, record) {
                self.felt_until = Some(now);
            }
            if record.mode.is_latched() {
                self.detected.get_or_insert(now);
                self.observed.cause = self.observed.cause.or(record.cause);
                let end = EndState::from_mode(record.mode);
                self.observed.end_state = self.observed.end_state.or(end);
            }
            self.observed.is_stopped |= record.mode.is_stopped();
            if record.mode.allows_torque() {
                let error = (record.output.q - world.plant().q()).amax();
                self.observed.armed_error.get_or_insert(error);
            }
            if record.mode == Mode::DrivesOff {
                self.drives_off.get_or_insert(now);
            }
            self.power.update(now, record.mode, world.drives());
        }
        self.before = now;
        self.last = (bench.node().bus().stations().now(), grip);
    }

    /// Returns the observation, with times from the onset.
    pub(super) fn finish<S: InputSink + Clone>(
        mut self,
        bench: &mut Bench<Monitor, S>,
        onset: Instant,
    ) -> Observation {
        let since = |at: Instant| at.since(onset);
        let torque_free = bench.node().bus().stations().zero_torque_since();
        let monitor = bench.tap_mut();
        self.observed.detected = self.detected.map(since);
        self.observed.zero = monitor.all_zero_since().map(since);
        self.observed.torque_free = torque_free.map(since);
        self.observed.off = self.power.time();
        self.observed.drives_off = self.drives_off.map(since);
        self.observed.is_left_on = self.power.is_left_on(self.before);
        self.observed.reflection_off = Some(self.felt_until.map(since).unwrap_or_default());
        self.observed.spread = monitor.spread();
        self.observed.stale = monitor.stale_targets();
        self.observed.unarmed = monitor.unarmed_frames();
        self.observed.violations = monitor.violations().to_vec();
        self.observed.violation_count = monitor.violation_count();
        self.observed
    }
}

/// Returns the time after "drives off" at which every power stage must be off. A drive without frames stops by its own
/// timers, which frames from a stalled adapter restart; a drive without RPDOs is switched off by SDO.
pub(super) fn off_tolerance(config: &Config, injection: &Injection) -> Duration {
    if injection.loses_commands {
        return OFF_TOLERANCE + timers::power_off_by_sdo(config);
    }
    let stall = injection.faults().find_map(stall).unwrap_or_default();
    OFF_TOLERANCE.max(timers::slowest(config) + stall)
}

/// Returns the time for which a fault delays the frames of a bus.
fn stall(fault: &Fault) -> Option<Duration> {
    let is_stall = matches!(fault.kind, FaultKind::Bus(Disturbance::AdapterStalled));
    fault.duration.filter(|_| is_stall)
}

/// Power stages of the drives after a stop.
#[derive(Clone, Copy, Debug)]
struct PowerStages {
    tolerance: Duration,
    stopped: Option<Instant>,
    /// Time by which every power stage must be off.
    due: Option<Instant>,
    /// Time since which every power stage is off.
    off: Option<Instant>,
}

impl PowerStages {
    const fn new(tolerance: Duration) -> Self {
        Self { tolerance, stopped: None, due: None, off: None }
    }

    /// Takes the node's mode and the drives' own states after a cycle.
    fn update(&mut self, now: Instant, mode: Mode, drives: &[Drive]) {
        if mode.is_stopped() {
            self.stopped.get_or_insert(now);
            self.due.get_or_insert(now + OFF_AFTER);
        }
        if mode == Mode::DrivesOff {
            self.due = self.due.map(|due| due.min(now));
        }
        let are_off = drives.iter().all(|drive| is_off(drive.state()));
        self.off = are_off.then(|| self.off.unwrap_or(now));
    }

    /// Returns the time from the stop until the last power stage was off.
    fn time(&self) -> Option<Duration> {
        Some(self.off?.since(self.stopped?))
    }

    /// Returns whether a power stage was on after it had to be off, until the end of the observation.
    fn is_left_on(&self, until: Instant) -> bool {
        let is_late = |due: Instant| self.off.unwrap_or(until) > due + self.tolerance;
        self.due.is_some_and(is_late)
    }
}

fn grip<S: InputSink + Clone>(bench: &Bench<Monitor, S>) -> Vector3<f64> {
    bench.node().bus().stations().plant().x_0_g().translation.vector
}

/// Returns whether more than the arm's weight, as described and as held, acts on a joint.
fn is_reflecting(config: &Config, record: &Record) -> bool {
    if record.targets == [0; 6] {
        return false;
    }
    let rest = record.output.tau - record.output.ledger.gravity - record.output.ledger.hold;
    let mut joints = rest.iter().zip(&config.joints);
    joints.any(|(torque, joint)| torque.abs() > MIN_FELT * joint.plant.actuator.max_torque)
}
