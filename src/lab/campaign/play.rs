//! One case: from a bench in its situation to a verdict.

use std::fmt;
use std::time::Duration;

use nalgebra::Vector3;

use crate::bench::Bench;
use crate::campaign::case::Case;
use crate::campaign::criterion::Criterion;
use crate::campaign::expectation::EndState;
use crate::campaign::injection::Injection;
use crate::campaign::monitor::{self, Answer, Exemption, Monitor};
use crate::campaign::rpdo_loss::RpdoLoss;
use crate::campaign::situation::Situation;
use crate::campaign::timers;
use crate::campaign::verdict::{Observation, Verdict};
use canopen::drive::State;
use config::Config;
use faults::{Disturbance, Fault, HostFault, Kind, Target};
use node::record::{Mode, Record};
use node::{BringUpError, Request};
use sim::drive::Drive;
use sim::quirks::Quirk;
use sim::scenario::{Problem, Scenario};
use units::numbering::Joint;
use units::time::Instant;

/// Time after the onset in which speed and displacement of the grip are measured.
const GRIP_MEASURED: Duration = Duration::from_millis(100);

/// Virtual time allowed for a boot; those of the shipped configurations take less than a second.
const BOOT_TIMEOUT: Duration = Duration::from_secs(20);

/// Time between zero torque and the drives' power off (S2).
const OFF_AFTER: Duration = Duration::from_millis(100);

/// Time allowed beyond that: one controlword goes out at a time, and acts at the drive's next SYNC.
const OFF_TOLERANCE: Duration = Duration::from_millis(15);

/// Least reflected torque that can be felt, as a share of a joint's capacity.
const MIN_FELT: f64 = 0.02;

/// Least force of an object in contact, in N.
const MIN_CONTACT: f64 = 2.0;

/// A case that cannot be played.
#[derive(Debug)]
pub enum StageError {
    /// A scenario that is invalid.
    Scenario(Problem),
    /// The network does not come up.
    Boot(BringUpError),
    /// The network is not up when `BOOT_TIMEOUT` is over.
    BootTimeout,
    /// The situation is not reached.
    NotReached(Situation, Mode),
    /// An invariant is violated before the fault.
    Violated(String),
}

impl fmt::Display for StageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scenario(problem) => write!(f, "scenario: {problem}"),
            Self::Boot(error) => write!(f, "{error}"),
            Self::BootTimeout => {
                let seconds = BOOT_TIMEOUT.as_secs();
                write!(f, "the boot must end within {seconds} s of virtual time, and did not")
            }
            Self::NotReached(situation, mode) => {
                write!(f, "the node must be {situation} before the fault, and is {mode}")
            }
            Self::Violated(violation) => write!(f, "before any fault: {violation}"),
        }
    }
}

impl std::error::Error for StageError {}

/// A function that is called after every cycle.
pub(super) type OnCycle<'a> = dyn FnMut(&mut Bench<Monitor>, &Record) + 'a;

/// Brings a bench into a situation; `seed` is that of the hand's tremor. No drive may exert torque before it is armed,
/// the proof test included (promise 9).
pub(super) fn bring_to(
    config: &Config,
    situation: Situation,
    seed: u64,
    monitor: Monitor,
    quirk: Option<(Joint, Quirk)>,
) -> Result<Bench<Monitor>, StageError> {
    let seconds = situation.reached_s() + 2.0;
    let mut scenario = Scenario::new(seconds, situation.entries()).map_err(StageError::Scenario)?;
    if let Some((joint, quirk)) = quirk {
        scenario.quirks_mut().add(joint, [quirk]);
    }
    let mut bench = Bench::new(config, scenario, seed, false, monitor);
    bring_up(&mut bench)?;
    let (mut last, mut is_unarmed) = (None, true);
    // Without a first SYNC the scenario never begins.
    let end = bench.now() + BOOT_TIMEOUT;
    while bench.elapsed().as_secs_f64() < situation.reached_s() && bench.now() < end {
        make_requests(&mut bench);
        let record = bench.cycle();
        report_mode(&mut bench, record.mode);
        is_unarmed &= matches!(record.mode, Mode::Boot | Mode::Ready);
        if is_unarmed && bench.node().bus().stations().zero_torque_since() != Some(Instant::ZERO) {
            return Err(StageError::Violated("a drive exerts torque, and is not armed".to_owned()));
        }
        last = Some((record.mode, record.f_s.force.norm()));
    }
    let (mode, force) = last.unwrap_or((Mode::Boot, 0.0));
    let is_there = match situation {
        Situation::Ready => mode == Mode::Ready,
        Situation::Armed => mode == Mode::Armed,
        Situation::Free => mode == Mode::Engaged,
        Situation::Contact => mode == Mode::Engaged && force > MIN_CONTACT,
    };
    if let Some(violation) = bench.tap_mut().violations().first() {
        return Err(StageError::Violated(violation.to_string()));
    }
    if is_there { Ok(bench) } else { Err(StageError::NotReached(situation, mode)) }
}

/// Boots the network of a bench.
///
/// # Errors
/// When it does not come up, or is not up when [`BOOT_TIMEOUT`] is over.
pub(super) fn bring_up(bench: &mut Bench<Monitor>) -> Result<(), StageError> {
    bench.bring_up_within(BOOT_TIMEOUT).map_err(|error| match error {
        BringUpError::GivenUp | BringUpError::LeftOn(_) => StageError::BootTimeout,
        error @ (BringUpError::Boot(_)
        | BringUpError::Bus(_)
        | BringUpError::Unfit(_)
        | BringUpError::NotEnabled(_)
        | BringUpError::ProofTest(_)) => StageError::Boot(error),
    })
}

/// Makes the requests of the scenario that are due, and reports the node's answers to the monitor. Returns whether
/// there was one.
pub(super) fn make_requests(bench: &mut Bench<Monitor>) -> bool {
    let mut is_made = false;
    while let Some(request) = bench.due() {
        make(bench, request);
        is_made = true;
    }
    is_made
}

fn make(bench: &mut Bench<Monitor>, request: Request) {
    let mode = bench.ask(request).ok();
    let now = bench.now();
    let answer = match (request, mode) {
        (_, None) | (Request::Command(_), _) => return,
        (Request::Arm, Some(_)) => Answer::Armed,
        (Request::Reset, Some(Mode::Armed)) => Answer::ResetToArmed,
        (Request::Disarm | Request::Reset, Some(_)) => Answer::Disarmed,
    };
    bench.tap_mut().on_answer(now, answer);
}

/// Reports the mode of a cycle to the monitor.
pub(super) fn report_mode(bench: &mut Bench<Monitor>, mode: Mode) {
    let now = bench.now();
    let mode = match mode {
        Mode::ZeroTorque | Mode::DrivesOff => monitor::Mode::Stopped,
        Mode::Engaged => monitor::Mode::Engaged,
        Mode::Boot | Mode::Ready | Mode::Armed | Mode::ReflectionOff => monitor::Mode::Other,
    };
    bench.tap_mut().on_mode(now, mode);
}

/// Plays a case on a bench in its situation, which cannot be used again.
pub(super) fn play(
    bench: &mut Bench<Monitor>,
    config: &Config,
    case: &Case,
    on_cycle: &mut OnCycle<'_>,
) -> Result<Verdict, StageError> {
    bench.follow(case.scenario().map_err(StageError::Scenario)?, case.seed);
    bench.tap_mut().forget();
    let zero = bench.begun();
    for fault in case.injection.faults() {
        exemption(config.period, zero, fault)
            .into_iter()
            .for_each(|exemption| bench.tap_mut().exempt(exemption));
    }
    let mut onset = zero + case.onset;
    let mut loss = case.injection.cut_off.map(RpdoLoss::new);
    let mut observer = Observer::new(bench, off_tolerance(config, &case.injection));
    let observed_for = case.injection.observed_for;
    let (mut is_tried, mut is_fast) = (false, false);
    while bench.now() < onset + observed_for {
        if make_requests(bench) {
            onset = bench.now();
        }
        // A latched mode is left by a reset alone.
        if !is_tried && bench.now() > onset + observed_for * 3 / 4 && observer.is_latched() {
            make(bench, Request::Arm);
            is_tried = true;
        }
        let record = bench.cycle();
        let now = bench.now();
        report_mode(bench, record.mode);
        observer.update(bench, config, onset, &record);
        let speed = observer.observed.speed;
        if case.injection.onset_speed.is_some_and(|limit| !is_fast && speed > limit) {
            (is_fast, onset) = (true, now);
        }
        let is_on = now >= onset && !observer.is_latched();
        for loss in loss.iter_mut().filter(|_| is_on) {
            loss.update(now, bench.tap_mut().target(loss.joint()));
        }
        on_cycle(bench, &record);
    }
    let criterion = match &loss {
        Some(loss) if !observer.is_latched() && loss.longest() <= held_limit(&case.injection) => {
            Criterion::Either("the held torque hardly differs from the targets")
        }
        Some(loss) => {
            onset = loss.since().unwrap_or(onset);
            case.injection.criterion
        }
        None => case.injection.criterion,
    };
    if !observer.is_latched() {
        // A failed drive may not confirm the stop; the monitor judges the order of the frames all the same.
        bench.stop().ok();
    }
    Ok(Verdict::of(case, criterion, config, observer.finish(bench, onset)))
}

/// Returns the time for which a held torque may differ unseen.
fn held_limit(injection: &Injection) -> Duration {
    match injection.criterion {
        Criterion::Stop(within) | Criterion::TorqueFree(within) => within,
        Criterion::ZeroTorque(_)
        | Criterion::BusAbandoned(..)
        | Criterion::ReflectionOff(_)
        | Criterion::Disengaged(..)
        | Criterion::GoesOn
        | Criterion::Either(_) => Duration::MAX,
    }
}

/// Returns the exemption from I5 that a fault of bus or host grants.
fn exemption(period: Duration, zero: Instant, fault: &Fault) -> Option<Exemption> {
    let at = zero + fault.start;
    let span = fault.duration.unwrap_or_default();
    match (fault.kind, fault.target) {
        (Kind::Bus(Disturbance::ErrorWarning | Disturbance::ErrorPassive), _) => None,
        (Kind::Bus(_), Target::Bus(channel)) => Some(Exemption::Bus(channel, at)),
        (Kind::Host(HostFault::ProcessStopped | HostFault::Suspended), _) => {
            Some(Exemption::Process(at, at + span + period * 2))
        }
        // The frame comes within a period.
        (Kind::Host(HostFault::ProcessStoppedAfter(_)), _) => {
            Some(Exemption::Process(at, at + span + period * 3))
        }
        (
            Kind::Bus(_)
            | Kind::Host(HostFault::ClockSet(_))
            | Kind::Disconnection(_)
            | Kind::Frames(_)
            | Kind::Imitation { .. }
            | Kind::Device(_)
            | Kind::Sensor(_)
            | Kind::Contact(..)
            | Kind::ForeignFrame { .. }
            | Kind::Link(_)
            | Kind::SensedForce(_),
            _,
        ) => None,
    }
}

/// Measures node, bus and arm after every cycle.
#[derive(Debug)]
struct Observer {
    before: Instant,
    start: Vector3<f64>,
    last: Vector3<f64>,
    felt_until: Option<Instant>,
    detected: Option<Instant>,
    power: PowerStages,
    drives_off: Option<Instant>,
    observed: Observation,
}

/// Returns the time beyond "drives off" at which every power stage must be off. A node that has abandoned its bus leaves
/// that to the drives' own timers, which frames from a stalled adapter start once more; a drive without its RPDOs is
/// switched off by SDO.
fn off_tolerance(config: &Config, injection: &Injection) -> Duration {
    if injection.loses_commands {
        return OFF_TOLERANCE + timers::power_off_by_sdo(config);
    }
    match injection.criterion {
        Criterion::BusAbandoned(..) | Criterion::TorqueFree(_) => {
            OFF_TOLERANCE.max(timers::slowest(config))
        }
        Criterion::Stop(_)
        | Criterion::ZeroTorque(_)
        | Criterion::ReflectionOff(_)
        | Criterion::Disengaged(..)
        | Criterion::GoesOn
        | Criterion::Either(_) => match injection.faults().find_map(stall) {
            Some(stall) => OFF_TOLERANCE.max(timers::slowest(config) + stall),
            None => OFF_TOLERANCE,
        },
    }
}

/// Returns the time for which a fault holds the frames of a bus back.
fn stall(fault: &Fault) -> Option<Duration> {
    let is_stall = matches!(fault.kind, Kind::Bus(Disturbance::AdapterStalled));
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
        let is_on = drives.iter().any(|drive| has_voltage(drive.state()));
        self.off = if is_on { None } else { Some(self.off.unwrap_or(now)) };
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

/// Returns whether a drive in this state has voltage on its motor (CiA 402-2, 6.1).
const fn has_voltage(state: State) -> bool {
    match state {
        State::NotReadyToSwitchOn
        | State::SwitchOnDisabled
        | State::ReadyToSwitchOn
        | State::Fault => false,
        State::SwitchedOn
        | State::OperationEnabled
        | State::QuickStopActive
        | State::FaultReactionActive => true,
    }
}

impl Observer {
    fn new(bench: &Bench<Monitor>, off_tolerance: Duration) -> Self {
        let grip = grip(bench);
        Self {
            before: bench.now(),
            start: grip,
            last: grip,
            felt_until: None,
            detected: None,
            power: PowerStages::new(off_tolerance),
            drives_off: None,
            observed: Observation::default(),
        }
    }

    const fn is_latched(&self) -> bool {
        self.detected.is_some()
    }

    /// Takes a cycle.
    fn update(&mut self, bench: &Bench<Monitor>, config: &Config, onset: Instant, record: &Record) {
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
            if now.since(onset) <= GRIP_MEASURED {
                let cycle = now.since(self.before).as_secs_f64().max(1e-6);
                self.observed.speed = self.observed.speed.max((grip - self.last).norm() / cycle);
                self.observed.travel = self.observed.travel.max((grip - self.start).norm());
            }
            if is_reflecting(config, record) {
                self.felt_until = Some(now);
            }
            if record.mode.is_latched() {
                self.detected.get_or_insert(now);
                self.observed.cause = self.observed.cause.or(record.cause);
                let end = EndState::of(record.mode);
                self.observed.end_state = self.observed.end_state.or(end);
            }
            self.observed.is_stopped |= record.mode.is_stopped();
            if record.mode == Mode::DrivesOff {
                self.drives_off.get_or_insert(now);
            }
            self.power.update(now, record.mode, world.drives());
        }
        self.before = now;
        self.last = grip;
    }

    fn finish(mut self, bench: &mut Bench<Monitor>, onset: Instant) -> Observation {
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

fn grip(bench: &Bench<Monitor>) -> Vector3<f64> {
    bench.node().bus().stations().plant().x_0_g().translation.vector
}

/// Returns whether more than the arm's weight acts on a joint.
fn is_reflecting(config: &Config, record: &Record) -> bool {
    if record.targets == [0; 6] {
        return false;
    }
    let rest = record.output.tau - record.output.ledger.gravity;
    let mut joints = rest.iter().zip(&config.joints);
    joints.any(|(torque, joint)| torque.abs() > MIN_FELT * joint.plant.actuator.max_torque)
}
