//! One case: from a warm bench to a verdict.

use std::fmt;
use std::time::Duration;

use nalgebra::Vector3;

use crate::bench::Bench;
use crate::campaign::case::Case;
use crate::campaign::monitor::Excuse;
use crate::campaign::monitor::Monitor;
use crate::campaign::situation::Situation;
use crate::campaign::verdict::Seen;
use crate::campaign::verdict::Verdict;
use bus::BusFault;
use bus::Disturbance;
use bus::HostFault;
use canopen::drive::State;
use config::Config;
use node::BringUpError;
use node::Request;
use node::record::Mode;
use node::record::Record;
use sim::drive::Drive;
use sim::scenario::Scenario;
use sim::scenario::ScenarioError;
use units::spatial::Wrench;
use units::time::Instant;

/// The grip is watched for so long after the onset.
const WATCH_GRIP: Duration = Duration::from_millis(100);

/// Virtual time allowed for a boot; those of the shipped configurations take less than a second.
const BOOT_TIMEOUT: Duration = Duration::from_secs(20);

/// Time between zero torque and the drives' power off (S2).
const OFF_AFTER: Duration = Duration::from_millis(100);

/// Time allowed beyond that: one controlword goes out at a time, and acts at the drive's next SYNC.
const OFF_TOLERANCE: Duration = Duration::from_millis(15);

/// Less than this share of a joint's capacity is not felt.
const FELT: f64 = 0.02;

/// An object that is pressed against something feels at least so much, in N.
const CONTACT: f64 = 2.0;

/// Why no case can be played.
#[derive(Debug)]
pub enum StageError {
    /// A script that cannot be followed.
    Script(ScenarioError),
    /// The network does not come up.
    Boot(BringUpError),
    /// The network is not up when `BOOT_TIMEOUT` is over.
    BootTimeout,
    /// The operator does not come where the fault is to find him.
    Elsewhere(Situation, Mode),
    /// A law is broken before anything else is.
    Broken(String),
}

impl fmt::Display for StageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Script(error) => write!(f, "script: {error}"),
            Self::Boot(error) => write!(f, "{error}"),
            Self::BootTimeout => {
                let seconds = BOOT_TIMEOUT.as_secs();
                write!(f, "the boot must end within {seconds} s of virtual time, and did not")
            }
            Self::Elsewhere(situation, mode) => write!(f, "never {situation}: the node is {mode}"),
            Self::Broken(breach) => write!(f, "before any fault: {breach}"),
        }
    }
}

impl std::error::Error for StageError {}

/// Somebody who is told of every cycle.
pub(super) type Witness<'a> = dyn FnMut(&mut Bench<Monitor>, &Record) + 'a;

/// Brings a bench to where a fault of this situation may strike; `seed` is of the hand's tremor.
pub(super) fn warm(
    config: &Config,
    situation: Situation,
    seed: u64,
    monitor: Monitor,
) -> Result<Bench<Monitor>, StageError> {
    let seconds = situation.warm_s() + 2.0;
    let script = format!("seconds = {seconds}\n\n{}", situation.entries());
    let scenario = Scenario::parse(&script).map_err(StageError::Script)?;
    let mut bench = Bench::new(config, scenario, seed, false, monitor);
    bring_up(&mut bench)?;
    let mut last = None;
    // A script that never begins, as without a first SYNC, does not make it wait for ever.
    let end = bench.now() + BOOT_TIMEOUT;
    while bench.elapsed().as_secs_f64() < situation.warm_s() && bench.now() < end {
        answer(&mut bench);
        let record = bench.cycle();
        let now = bench.now();
        bench.tap_mut().told(now, record.mode);
        last = Some((record.mode, record.f_s.force.norm()));
    }
    let (mode, force) = last.unwrap_or((Mode::Boot, 0.0));
    let is_there = match situation {
        Situation::Armed => mode == Mode::Armed,
        Situation::Free => mode == Mode::Engaged,
        Situation::Contact => mode == Mode::Engaged && force > CONTACT,
    };
    if let Some(breach) = bench.tap_mut().breaches().first() {
        return Err(StageError::Broken(breach.to_string()));
    }
    if is_there { Ok(bench) } else { Err(StageError::Elsewhere(situation, mode)) }
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
        | BringUpError::NotProven(_)) => StageError::Boot(error),
    })
}

/// Asks the node what the script asks of the console by now, and tells the judge what it answered. Whether
/// anything was asked.
pub(super) fn answer(bench: &mut Bench<Monitor>) -> bool {
    let mut is_asked = false;
    while let Some(request) = bench.due() {
        ask(bench, request);
        is_asked = true;
    }
    is_asked
}

fn ask(bench: &mut Bench<Monitor>, request: Request) {
    let mode = bench.ask(request).ok();
    let now = bench.now();
    bench.tap_mut().asked(now, request, mode);
}

/// Plays a case on a warm bench, which is spent then.
pub(super) fn play(
    bench: &mut Bench<Monitor>,
    config: &Config,
    case: &Case,
    witness: &mut Witness<'_>,
) -> Result<Verdict, StageError> {
    let scenario = Scenario::parse(&case.script()).map_err(StageError::Script)?;
    bench.follow(scenario, case.seed);
    bench.tap_mut().forget();
    let mut onset = bench.begun() + case.onset;
    for (after, host_fault) in &case.injection.host_faults {
        bench.bus_mut().plan(onset + *after, *host_fault);
        excuse(config.period, onset + *after, *host_fault)
            .into_iter()
            .for_each(|excuse| bench.tap_mut().excuse(excuse));
    }
    let mut watch = Watch::new(bench);
    let (mut is_tried, mut is_fast) = (false, false);
    while bench.now() < onset + case.injection.watch {
        if answer(bench) {
            onset = bench.now();
        }
        if let Some(force) = case.injection.senses.filter(|_| bench.now() >= onset) {
            let force = Vector3::new(force, 0.0, 0.0);
            bench.site_mut().break_sensor(Wrench { force, moment: Vector3::zeros() });
        }
        // A latch is left by a reset alone.
        if !is_tried && bench.now() > onset + case.injection.watch * 3 / 4 && watch.is_latched() {
            ask(bench, Request::Arm);
            is_tried = true;
        }
        let record = bench.cycle();
        let now = bench.now();
        bench.tap_mut().told(now, record.mode);
        watch.look(bench, config, onset, &record);
        if case.injection.onset_speed.is_some_and(|limit| !is_fast && watch.seen.speed > limit) {
            (is_fast, onset) = (true, now);
        }
        witness(bench, &record);
    }
    if !watch.is_latched() {
        // Drives that are broken may not confirm it; the order of what they are told is judged all the same.
        bench.stop().ok();
    }
    Ok(Verdict::of(case, config.period, watch.finish(bench, onset)))
}

/// What a host_fault makes nobody's fault.
fn excuse(period: Duration, at: Instant, host_fault: HostFault) -> Option<Excuse> {
    match host_fault {
        HostFault::Bus(
            _,
            None | Some(Disturbance::Fault(BusFault::Warning | BusFault::Passive)),
        )
        | HostFault::ClockSet(_) => None,
        HostFault::Bus(channel, Some(_)) => Some(Excuse::Bus(channel, at)),
        HostFault::Stopped(span) | HostFault::Suspended(span) => {
            Some(Excuse::Process(at, at + span + period * 2))
        }
        // The frame comes within a period.
        HostFault::StoppedAfter(_, span) => Some(Excuse::Process(at, at + span + period * 3)),
    }
}

/// What is measured on the way.
#[derive(Debug)]
struct Watch {
    before: Instant,
    at_start: Vector3<f64>,
    last: Vector3<f64>,
    felt_until: Option<Instant>,
    detected: Option<Instant>,
    power: Power,
    given_up: Option<Instant>,
    seen: Seen,
}

/// Power stages of the drives after a stop.
#[derive(Clone, Copy, Debug, Default)]
struct Power {
    stopped: Option<Instant>,
    /// When every power stage must be off.
    due: Option<Instant>,
    /// Since when every power stage is off.
    off: Option<Instant>,
}

impl Power {
    /// Takes the node's mode and the drives' own states after a cycle.
    fn look(&mut self, now: Instant, mode: Mode, drives: &[Drive]) {
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

    /// Time from the stop until the last power stage was off.
    fn time(&self) -> Option<Duration> {
        Some(self.off?.since(self.stopped?))
    }

    /// Returns whether a power stage was on when none might be, as far as that was watched.
    fn is_left_on(&self, until: Instant) -> bool {
        let is_late = |due: Instant| self.off.unwrap_or(until) > due + OFF_TOLERANCE;
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

impl Watch {
    fn new(bench: &Bench<Monitor>) -> Self {
        let place = place(bench);
        let seen = Seen {
            detected: None,
            is_stopped: false,
            cause: None,
            off: None,
            given_up: None,
            is_left_on: false,
            zero: None,
            quiet: None,
            felt: None,
            spread: None,
            impulse: 0.0,
            peak: 0.0,
            speed: 0.0,
            travel: 0.0,
            stale: 0,
            applied: 0,
            oldest: Duration::ZERO,
            unarmed: 0,
            breaches: Vec::new(),
            breach_count: 0,
        };
        Self {
            before: bench.now(),
            at_start: place,
            last: place,
            felt_until: None,
            detected: None,
            power: Power::default(),
            given_up: None,
            seen,
        }
    }

    const fn is_latched(&self) -> bool {
        self.detected.is_some()
    }

    /// After a cycle.
    fn look(&mut self, bench: &Bench<Monitor>, config: &Config, onset: Instant, record: &Record) {
        let (now, place) = (bench.now(), place(bench));
        let dt = now.since(self.before.max(onset)).as_secs_f64();
        if now < onset {
            self.at_start = place;
        } else {
            let world = bench.node().bus().stations();
            self.seen.impulse += world.torques().abs().sum() * dt;
            self.seen.peak = self.seen.peak.max(bench.node().bus().tap().peak());
            let monitor = bench.node().bus().tap();
            let drives = world.drives().iter().zip(monitor.acting_ages());
            for (_, age) in drives.filter(|(drive, _)| drive.demand().abs() > 0.0) {
                self.seen.applied += u64::from(monitor.is_stale(age));
                self.seen.oldest = self.seen.oldest.max(age);
            }
            if now.since(onset) <= WATCH_GRIP {
                let cycle = now.since(self.before).as_secs_f64().max(1e-6);
                self.seen.speed = self.seen.speed.max((place - self.last).norm() / cycle);
                self.seen.travel = self.seen.travel.max((place - self.at_start).norm());
            }
            if is_felt(config, record) {
                self.felt_until = Some(now);
            }
            if record.mode.is_latched() {
                self.detected.get_or_insert(now);
                self.seen.cause = self.seen.cause.or(record.cause);
            }
            self.seen.is_stopped |= record.mode.is_stopped();
            if record.mode == Mode::DrivesOff {
                self.given_up.get_or_insert(now);
            }
            self.power.look(now, record.mode, world.drives());
        }
        self.before = now;
        self.last = place;
    }

    fn finish(mut self, bench: &mut Bench<Monitor>, onset: Instant) -> Seen {
        let since = |at: Instant| at.since(onset);
        let quiet = bench.node().bus().stations().zero_torque_since();
        let monitor = bench.tap_mut();
        self.seen.detected = self.detected.map(since);
        self.seen.zero = monitor.all_zero_since().map(since);
        self.seen.quiet = quiet.map(since);
        self.seen.off = self.power.time();
        self.seen.given_up = self.given_up.map(since);
        self.seen.is_left_on = self.power.is_left_on(self.before);
        self.seen.felt = Some(self.felt_until.map(since).unwrap_or_default());
        self.seen.spread = monitor.spread();
        self.seen.stale = monitor.stale_targets();
        self.seen.unarmed = monitor.unarmed_frames();
        self.seen.breaches = monitor.breaches().to_vec();
        self.seen.breach_count = monitor.breach_count();
        self.seen
    }
}

fn place(bench: &Bench<Monitor>) -> Vector3<f64> {
    bench.node().bus().stations().plant().x_0_g().translation.vector
}

/// Whether anything but the arm's weight acts on a joint.
fn is_felt(config: &Config, record: &Record) -> bool {
    if record.targets == [0; 6] {
        return false;
    }
    let rest = record.output.tau - record.output.ledger.gravity;
    let mut joints = rest.iter().zip(&config.joints);
    joints.any(|(torque, joint)| torque.abs() > FELT * joint.plant.actuator.max_torque)
}
