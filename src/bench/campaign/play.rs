//! One case, from a bench in its situation to a verdict. `stage` prepares the bench, `observer` measures.

use std::time::Duration;

use crate::case::Case;
use crate::criterion::Criterion;
use crate::injection::Injection;
use crate::monitor::{Exemption, Monitor};
use crate::observer::{self, Observer};
use crate::rpdo_loss::RpdoLoss;
use crate::stage::{StageError, make, make_requests, report_mode};
use crate::verdict::Verdict;
use config::Config;
use faults::{Disturbance, Fault, FaultKind, HostFault, Target};
use inputs::InputSink;
use node::Request;
use node::record::Record;
use testbench::bench::Bench;
use units::time::Instant;

/// Function that is called after every cycle.
pub(super) type OnCycle<'a, S> = dyn FnMut(&mut Bench<Monitor, S>, &Record) + 'a;

/// Plays a case on a bench in its situation, which cannot be used again.
pub(super) fn play<S: InputSink + Clone>(
    bench: &mut Bench<Monitor, S>,
    config: &Config,
    case: &Case,
    on_cycle: &mut OnCycle<'_, S>,
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
    let mut observer = Observer::new(bench, observer::off_tolerance(config, &case.injection));
    let observed_for = case.injection.observed_for;
    let (mut is_tried, mut is_fast) = (false, false);
    while bench.now() < onset + observed_for {
        if make_requests(bench) {
            onset = bench.now();
        }
        // Only a reset may leave a latched mode.
        if !is_tried && bench.now() > onset + observed_for * 3 / 4 && observer.is_latched() {
            make(bench, Request::Arm);
            is_tried = true;
        }
        let (before, record) = (bench.now(), bench.cycle());
        let now = bench.now();
        report_mode(bench, record.mode);
        observer.update(bench, config, onset, &record);
        let is_faster = case.injection.onset_speed.is_some_and(|limit| observer.is_faster(limit));
        if is_faster && !is_fast {
            (is_fast, onset) = (true, before);
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
        // A failed drive may not confirm the stop; the monitor still checks the order of the frames.
        bench.shut_down().ok();
    }
    Ok(Verdict::new(case, criterion, config, observer.finish(bench, onset)))
}

/// Returns the time for which a held torque may differ from the target without detection.
fn held_limit(injection: &Injection) -> Duration {
    match injection.criterion {
        Criterion::Stop(within) | Criterion::TorqueFree(within) => within,
        Criterion::ZeroTorque(_)
        | Criterion::BusAbandoned(..)
        | Criterion::ReflectionOff(_)
        | Criterion::Disengaged(..)
        | Criterion::GoesOn
        | Criterion::Armed(_)
        | Criterion::Unarmed
        | Criterion::Either(_) => Duration::MAX,
    }
}

/// Returns the exemption from I5 that a fault of bus or host grants.
fn exemption(period: Duration, zero: Instant, fault: &Fault) -> Option<Exemption> {
    let at = zero + fault.start;
    if let (FaultKind::Bus(disturbance), Target::Bus(channel)) = (fault.kind, fault.target) {
        let is_error = matches!(disturbance, Disturbance::ErrorWarning | Disturbance::ErrorPassive);
        return (!is_error).then_some(Exemption::Bus(channel, at));
    }
    let FaultKind::Host(host) = fault.kind else { return None };
    let periods = match host {
        HostFault::ProcessStopped | HostFault::Suspended(None) => 2,
        // The frame comes within a period.
        HostFault::ProcessStoppedAfter(_) | HostFault::Suspended(Some(_)) => 3,
        HostFault::ClockSet(_) => return None,
    };
    let span = fault.duration.unwrap_or_default();
    Some(Exemption::Process(at, at + span + period * periods))
}
