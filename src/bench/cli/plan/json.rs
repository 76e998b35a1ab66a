//! JSON of a plan, with the units in the keys. An unbounded value is null.

use std::time::Duration;

use serde_json::{Value as Json, json};

use crate::plan::{Report, reason, text};
use canopen::load::network::Bus;
use canopen::load::pace::Pace;
use canopen::load::proposals::Proposal;
use canopen::load::rates::Rates;
use canopen::load::streams::Sender;
use canopen::load::timeline::{CycleStage, CycleStep, Timeline};
use canopen::load::utilisation::BusLoad;
use canopen_tools::bus_figures::loop_delay::LoopDelay;
use canopen_tools::bus_figures::{Both, BusPlan, PlannedFrame};
use config::Config;
use run::stopping;

/// Returns the report as one JSON object.
pub(super) fn object(report: &Report<'_>, config: &Config) -> String {
    let assumed = &report.assumed;
    let network = report.network;
    let buses = report.buses.iter().zip(&network.buses);
    let buses = buses.map(|(plan, bus)| of_bus(plan, bus, report));
    json!({
        "fits": report.buses.iter().all(BusPlan::fits),
        "sync_period_us": network.period_us,
        "assumed": {
            "drive_us": assumed.pauses.drive_us,
            "host_us": assumed.pauses.host_us,
            "emergency_gap_us": assumed.emergency_gap_us,
            "sdo_gap_us": assumed.sdo_gap_us,
            "error_gap_us": assumed.error_gap_us,
        },
        "buses": buses.collect::<Vec<_>>(),
        "stopping": stopping::json(config),
        "facts": stopping::facts_json(&config.facts()),
        "cautions": stopping::cautions_json(config),
        "proposals": report.proposals.iter().map(proposal).collect::<Vec<_>>(),
        "not_grouped_because": report.obstacles.iter().map(|obstacle| json!({
            "drive": obstacle.drive,
            "reason": reason(obstacle),
        })).collect::<Vec<_>>(),
    })
    .to_string()
}

fn of_bus(plan: &BusPlan, bus: &Bus, report: &Report<'_>) -> Json {
    let all = &plan.utilisation;
    json!({
        "name": plan.name,
        "bitrate": plan.bitrate,
        "fits": plan.fits(),
        "cycle_is_done_in_time": plan.is_done_within(report.network.period_us),
        "limit_percent": plan.load_limit_percent,
        "load": {
            "cycle_unstuffed": load(&all.cycle_least),
            "cycle_worst": load(&all.cycle_worst),
            "unstuffed": load(&all.least),
            "typical": load(&all.typical),
            "worst": load(&all.worst),
            "busiest": load(&all.busiest),
            "with_emergencies_and_sdo": load(&all.with_sporadic),
        },
        "left_bits_per_s": plan.margin.bits_per_s,
        "left_expedited_sdo_per_s": plan.margin.expedited_sdo_per_s,
        "highest_rate_hz": both(&plan.rates, rates),
        "frames": plan.frames.iter().map(|it| frame(it, &report.names.frame(plan, &it.stream), bus)).collect::<Vec<_>>(),
        "cycle": both(&plan.timeline, timeline),
        "loop_delay_us": both(&plan.loop_delay, loop_delay),
    })
}

fn both<T>(both: &Both<T>, of: fn(&T) -> Json) -> Json {
    json!({ "worst": of(&both.worst), "typical": of(&both.typical) })
}

fn load(load: &BusLoad) -> Json {
    json!({ "bits_per_cycle": load.used, "percent": load.percent() })
}

fn rates(rates: &Rates) -> Json {
    json!({
        "highest": rates.highest_hz(),
        "by_load": rates.load_hz,
        "by_cycle": rates.cycle_hz,
    })
}

fn frame(planned: &PlannedFrame, name: &str, bus: &Bus) -> Json {
    let stream = &planned.stream;
    let (sent, gap_us, timer_us) = match stream.pace {
        Pace::Clock { period_us } => ("clock", period_us, Some(period_us)),
        Pace::Change { gap_us, timer_us, .. } => ("change", gap_us, timer_us),
        Pace::Chance { gap_us } => ("chance", gap_us, None),
    };
    json!({
        "cob_id": stream.cob_id,
        "name": name,
        "role": text::role(stream.role),
        "of": text::nodes(stream, bus),
        "nodes": stream.nodes.iter().map(|node| node.raw()).collect::<Vec<_>>(),
        "sender": match stream.sender {
            Sender::Master => "master",
            Sender::Node(_) => "node",
        },
        "bytes": stream.bytes,
        "bits": {
            "unstuffed": stream.least_bits(),
            "typical": planned.typical_bits,
            "worst": stream.worst_bits(),
        },
        "sent": sent,
        "least_gap_us": gap_us,
        "period_us": timer_us,
        "per_s": {
            "planned": stream.pace.planned_per_s(),
            "typical": stream.pace.typical_per_s(),
            "busiest": stream.pace.busiest_per_s(),
        },
        "response_us": micros(planned.response),
        "deadline_us": stream.deadline_us,
        "may_be_late": planned.is_late(),
    })
}

fn micros(bound: Option<Duration>) -> Option<f64> {
    bound.map(|bound| bound.as_secs_f64() * 1e6)
}

fn timeline(timeline: &Timeline) -> Json {
    json!({
        "steps": timeline.steps.iter().map(step).collect::<Vec<_>>(),
        "done_us": timeline.done_us,
        "done_if_blocked_us": timeline.blocked_us,
    })
}

fn step(step: &CycleStep) -> Json {
    let (what, cob_id) = match step.stage {
        CycleStage::Sync => ("SYNC", None),
        CycleStage::Drives => ("drives sample", None),
        CycleStage::Tpdo(cob_id) => ("TPDO", Some(cob_id)),
        CycleStage::Host => ("host computes", None),
        CycleStage::Rpdo(cob_id) => ("RPDO", Some(cob_id)),
    };
    json!({ "what": what, "cob_id": cob_id, "start_us": step.start_us, "end_us": step.end_us })
}

fn loop_delay(delay: &LoopDelay) -> Json {
    json!({
        "synchronous_rpdo": delay.synchronous_us,
        "event_driven_rpdo": { "first": delay.first_arrival_us, "last": delay.last_arrival_us },
    })
}

fn proposal(proposal: &Proposal) -> Json {
    json!({
        "changes": proposal.changes.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "fits": proposal.fits,
        "load_percent": proposal.loads.iter().map(BusLoad::percent).collect::<Vec<_>>(),
        "highest_rate_hz": proposal.highest_hz,
        "torque_response_us": micros(proposal.torque_response),
    })
}
