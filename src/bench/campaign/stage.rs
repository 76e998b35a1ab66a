//! Bench in the situation of a case: booted, armed, engaged.

use std::time::Duration;

use thiserror::Error;

use crate::monitor::{self, Answer, Monitor};
use crate::situation::Situation;
use config::Config;
use inputs::InputSink;
use node::record::{Mode, Record};
use node::{BringUpError, Request};
use sim::quirks::Quirk;
use sim::scenario::{Problem, Scenario};
use testbench::bench::{Bench, Course};
use testbench::side::Side;
use units::numbering::Joint;
use units::time::Instant;

/// Virtual time allowed for a boot; those of the shipped configurations take less than a second.
const BOOT_TIMEOUT: Duration = Duration::from_secs(20);

/// Minimum force of an object in contact, in N.
const MIN_CONTACT: f64 = 2.0;

/// Reason why a case cannot be played.
#[derive(Debug, Error)]
pub enum StageError {
    /// Invalid scenario.
    #[error("scenario: {0}")]
    Scenario(Problem),
    /// Network that does not boot.
    #[error("{0}")]
    Boot(BringUpError),
    /// Boot that took longer than `BOOT_TIMEOUT`.
    #[error("the boot must end within {} s of virtual time, and did not", BOOT_TIMEOUT.as_secs())]
    BootTimeout,
    /// Required situation, and the mode of the node instead.
    #[error("the node must be {0} before the fault, and is {1}")]
    NotReached(Situation, Mode),
    /// Configuration that cannot be changed for the case.
    #[error("{0}")]
    Configuration(String),
    /// Invariant that is violated before the fault.
    #[error("before any fault: {0}")]
    Violated(String),
}

/// Situation that a bench is brought into.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage<'a> {
    pub(super) config: &'a Config,
    pub(super) situation: Situation,
    /// Seed of the hand's tremor.
    pub(super) seed: u64,
    /// Quirk of a drive, present before its boot.
    pub(super) quirk: Option<(Joint, Quirk)>,
}

/// Brings a bench into a situation; the inputs of its node go to `sink`. Before arming no drive may exert torque, not even
/// in the proof test (promise 9).
pub(super) fn bring_to<S: InputSink + Clone>(
    Stage { config, situation, seed, quirk }: Stage<'_>,
    monitor: Monitor,
    sink: S,
    on_cycle: &mut dyn FnMut(&mut Bench<Monitor, S>, &Record),
) -> Result<Bench<Monitor, S>, StageError> {
    let seconds = situation.reached_s() + 2.0;
    let mut scenario = Scenario::new(seconds, situation.entries()).map_err(StageError::Scenario)?;
    if let Some((joint, quirk)) = quirk {
        scenario.quirks_mut().add(joint, [quirk]);
    }
    let course = Course { scenario, seed, speed: None };
    let mut bench = Bench::recorded(config, Side::from_config(config), course, monitor, sink);
    bring_up(&mut bench)?;
    let (mut last, mut is_unarmed) = (None, true);
    // Without a first SYNC the scenario never begins.
    let end = bench.now() + BOOT_TIMEOUT;
    while bench.elapsed().as_secs_f64() < situation.reached_s() && bench.now() < end {
        make_requests(&mut bench);
        let record = bench.cycle();
        report_mode(&mut bench, record.mode);
        on_cycle(&mut bench, &record);
        is_unarmed &= matches!(record.mode, Mode::Boot | Mode::Ready);
        if is_unarmed && bench.node().bus().stations().zero_torque_since() != Some(Instant::ZERO) {
            return Err(StageError::Violated("a drive exerts torque, and is not armed".to_owned()));
        }
        last = Some((record.mode, record.f_s.force.norm()));
    }
    let (mode, force) = last.unwrap_or((Mode::Boot, 0.0));
    let is_there = match situation {
        Situation::Ready => mode == Mode::Ready,
        Situation::Armed | Situation::Zeroed => mode == Mode::Armed,
        Situation::Parking => mode == Mode::Measuring,
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
/// Returns an error if the network does not boot, or takes longer than [`BOOT_TIMEOUT`].
pub(super) fn bring_up<S: InputSink + Clone>(
    bench: &mut Bench<Monitor, S>,
) -> Result<(), StageError> {
    bench.bring_up_within(BOOT_TIMEOUT).map_err(|error| match error {
        BringUpError::GivenUp | BringUpError::LeftOn(_) => StageError::BootTimeout,
        error @ (BringUpError::Boot(_)
        | BringUpError::Bus(_)
        | BringUpError::Unfit(_)
        | BringUpError::NotEnabled(_)
        | BringUpError::Mode(_)
        | BringUpError::Homing(_)
        | BringUpError::ProofTest(_)) => StageError::Boot(error),
    })
}

/// Makes the requests of the scenario whose time has come, and reports the node's answers to the monitor. Returns whether
/// a request was made.
pub(super) fn make_requests<S: InputSink + Clone>(bench: &mut Bench<Monitor, S>) -> bool {
    let mut is_made = false;
    while let Some(request) = bench.due() {
        make(bench, request);
        is_made = true;
    }
    is_made
}

/// Makes a request, and reports its answer to the monitor.
pub(super) fn make<S: InputSink + Clone>(bench: &mut Bench<Monitor, S>, request: Request) {
    let mode = bench.ask(request).ok();
    let now = bench.now();
    let answer = match (request, mode) {
        (_, None)
        | (
            Request::Command(_)
            | Request::Adjust(_)
            | Request::Zero(_)
            | Request::Park
            | Request::Trial(_),
            _,
        ) => {
            return;
        }
        (Request::Arm, Some(_)) => Answer::Armed,
        (Request::Reset, Some(Mode::Armed)) => Answer::ResetToArmed,
        (Request::Disarm | Request::Reset, Some(_)) => Answer::Disarmed,
    };
    bench.tap_mut().on_answer(now, answer);
}

/// Reports the mode of a cycle to the monitor.
pub(super) fn report_mode<S: InputSink + Clone>(bench: &mut Bench<Monitor, S>, mode: Mode) {
    let now = bench.now();
    let mode = match mode {
        Mode::ZeroTorque | Mode::DrivesOff => monitor::mode_class::ModeClass::Stopped,
        Mode::Engaged => monitor::mode_class::ModeClass::Engaged,
        Mode::Boot | Mode::Ready | Mode::Armed | Mode::ReflectionOff | Mode::Measuring => {
            monitor::mode_class::ModeClass::Other
        }
    };
    bench.tap_mut().on_mode(now, mode);
}
