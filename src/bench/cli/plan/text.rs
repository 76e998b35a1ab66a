//! Text of a plan: one or two screens per bus.

use std::time::Duration;

use crate::plan::{Names, Report, obstacle};
use canopen::load::network::Bus;
use canopen::load::pace::Pace;
use canopen::load::proposals::Proposal;
use canopen::load::streams::{Role, Stream};
use canopen::load::timeline::{CycleStage, CycleStep};
use canopen::load::utilisation::BusLoad;
use canopen_tools::bus_figures::{BusPlan, PlannedFrame};

/// Width of the timeline, in columns.
const COLUMNS: u32 = 50;

/// Returns the report, without a final line end.
pub(super) fn report(report: &Report<'_>) -> String {
    let mut lines = vec![head(report)];
    for (plan, bus) in report.buses.iter().zip(&report.network.buses) {
        lines.push(String::new());
        lines.extend(bus_lines(plan, bus, report));
    }
    let proposed = proposal_lines(report);
    if !proposed.is_empty() {
        lines.push(String::new());
        lines.extend(proposed);
    }
    lines.join("\n")
}

fn head(report: &Report<'_>) -> String {
    let period_us = report.network.period_us;
    let assumed = &report.assumed;
    let errors = assumed
        .error_gap_us
        .map_or_else(String::new, |gap| format!(", a bus error every {}", span(gap)));
    format!(
        "SYNC every {}, {:.0} Hz\nassumed: drives answer SYNC after {} µs, the host their last TPDO after \
         {} µs;\n  an emergency of each node every {}, an SDO exchange every {}{errors}",
        span(period_us),
        1e6 / f64::from(period_us.max(1)),
        assumed.pauses.drive_us,
        assumed.pauses.host_us,
        span(assumed.emergency_gap_us),
        span(assumed.sdo_gap_us),
    )
}

fn bus_lines(plan: &BusPlan, bus: &Bus, report: &Report<'_>) -> Vec<String> {
    let (period_us, names) = (report.network.period_us, &report.names);
    let verdict = match (plan.fits(), plan.is_done_within(period_us)) {
        (true, true) => "fits",
        (true, false) => "fits, but a cycle may not be done before the next SYNC",
        (false, _) => "does not fit",
    };
    let mut lines = vec![format!("bus {}, {} bit/s: {verdict}", plan.name, plan.bitrate)];
    lines.extend(load_lines(plan));
    lines.push(String::new());
    lines.extend(frame_lines(plan, bus, names));
    lines.push(String::new());
    lines.extend(cycle_lines(plan, bus, report));
    lines
}

fn load_lines(bus: &BusPlan) -> Vec<String> {
    let all = &bus.utilisation;
    let line = |what: &str, load: &BusLoad, note: &str| {
        let text = format!("  {what:<34}{:>9.1} bits{:>7.1} %  {note}", load.used, load.percent());
        text.trim_end().to_owned()
    };
    let limit = format!("limit {} %", bus.load_limit_percent);
    let rates = &bus.rates;
    let busiest = (all.busiest.used > all.worst.used)
        .then(|| line("with all values changing", &all.busiest, "as fast as inhibit times allow"));
    let mut lines = vec![
        line("SYNC and its PDOs, unstuffed", &all.cycle_least, "a cycle"),
        line("SYNC and its PDOs, worst case", &all.cycle_worst, ""),
        line("all planned frames, unstuffed", &all.least, ""),
        line("all planned frames, typically", &all.typical, ""),
        line("all planned frames, worst case", &all.worst, &limit),
    ];
    lines.extend(busiest);
    lines.push(line("with emergencies and SDO", &all.with_sporadic, ""));
    lines.push(format!(
        "  {:<34}{:>9.1} kbit/s, {:.0} expedited SDO/s",
        "free",
        bus.margin.bits_per_s / 1e3,
        bus.margin.expedited_sdo_per_s
    ));
    for (what, worst, typical) in [
        ("max rate by the load limit", rates.worst.load_hz, rates.typical.load_hz),
        ("max rate with the cycle in time", rates.worst.cycle_hz, rates.typical.cycle_hz),
    ] {
        lines.push(format!("  {what:<34}{worst:>9.0} Hz worst case, {typical:.0} Hz typically"));
    }
    lines
}

fn frame_lines(plan: &BusPlan, bus: &Bus, names: &Names) -> Vec<String> {
    let head = format!(
        "  {:<4} {:<12} {:<25} {:>5} {:>5} {:>6} {:>5}  {:<22} {:>9}",
        "id", "frame", "of", "bytes", "least", "typ", "bits", "every", "within µs"
    );
    let line = |frame: &PlannedFrame| {
        let stream = &frame.stream;
        let late = if frame.is_late() { " late" } else { "" };
        let mut of = nodes(stream, bus);
        if of.chars().count() > 25 {
            of = of.chars().take(24).chain(['…']).collect();
        }
        format!(
            "  {:03X}  {:<12} {of:<25} {:>5} {:>5} {:>6.1} {:>5}  {:<22} {:>9}{late}",
            stream.cob_id,
            names.frame(plan, stream),
            stream.bytes,
            stream.least_bits(),
            frame.typical_bits,
            stream.worst_bits(),
            pace(stream.pace),
            response(frame.response),
        )
    };
    let mut lines = vec![head];
    lines.extend(plan.frames.iter().map(line));
    if plan.frames.iter().any(PlannedFrame::is_late) {
        let late = "late: in the worst case, with all frames queued at once, this frame arrives after the next SYNC";
        lines.extend([format!("  {late}"), "  or after its receiver has timed out".to_owned()]);
    }
    lines
}

fn cycle_lines(plan: &BusPlan, bus: &Bus, report: &Report<'_>) -> Vec<String> {
    let period_us = report.network.period_us;
    let (worst, typical) = (&plan.timeline.worst, &plan.timeline.typical);
    let width_us = worst.done_us.max(f64::from(period_us));
    let mut lines = vec![format!(
        "  a cycle, in µs                     worst case      typically  0 {:>49}",
        format!("{width_us:.0}")
    )];
    for (step, usual) in worst.steps.iter().zip(&typical.steps) {
        lines.push(format!(
            "  {:<30}{:>7.0}-{:<6.0} {:>7.0}-{:<6.0} {}",
            stage(step.stage, plan, bus, &report.names),
            step.start_us,
            step.end_us,
            usual.start_us,
            usual.end_us,
            bar(step, width_us),
        ));
    }
    let delay = &plan.loop_delay;
    lines.push(format!(
        "  {:<30}{:>14.0} {:>14.0} if other frames fill every gap",
        "done", worst.blocked_us, typical.blocked_us
    ));
    lines.push(format!(
        "  {:<30}{:>14.0} {:>14.0} synchronous RPDO: all act at the next SYNC",
        "position to torque", delay.worst.synchronous_us, delay.typical.synchronous_us
    ));
    let arrivals = |first: f64, last: f64| format!("{first:.0}-{last:.0}");
    lines.push(format!(
        "  {:<30}{:>14} {:>14} event-driven RPDO: each acts on reception",
        "",
        arrivals(delay.worst.first_arrival_us, delay.worst.last_arrival_us),
        arrivals(delay.typical.first_arrival_us, delay.typical.last_arrival_us)
    ));
    lines
}

/// Draws a step of the timeline: filled while a frame is sent, dotted while drives or host compute.
fn bar(step: &CycleStep, width_us: f64) -> String {
    let mark = match step.stage {
        CycleStage::Drives | CycleStage::Host => '·',
        CycleStage::Sync | CycleStage::Tpdo(_) | CycleStage::Rpdo(_) => '█',
    };
    let column_us = width_us / f64::from(COLUMNS);
    let place = |column: u32| (f64::from(column) + 0.5) * column_us;
    let is_in = |column: u32| step.start_us <= place(column) && place(column) < step.end_us;
    let line: String = (0..COLUMNS).map(|column| if is_in(column) { mark } else { ' ' }).collect();
    line.trim_end().to_owned()
}

fn proposal_lines(report: &Report<'_>) -> Vec<String> {
    let period_us = report.network.period_us;
    let is_fine = |bus: &BusPlan| bus.fits() && bus.is_done_within(period_us);
    let is_wanting = !report.buses.iter().all(is_fine);
    let mut lines = Vec::new();
    if !report.proposals.is_empty() {
        let why = if is_wanting { "proposals to make it fit" } else { "faster alternatives" };
        lines.push(format!("{why}, computed for the worst case:"));
    }
    lines.extend(report.proposals.iter().map(proposal));
    if is_wanting {
        lines.extend(report.obstacles.iter().map(|it| format!("  {}", obstacle(it))));
    }
    lines
}

fn proposal(proposal: &Proposal) -> String {
    let changes: Vec<String> = proposal.changes.iter().map(ToString::to_string).collect();
    let loads: Vec<String> =
        proposal.loads.iter().map(|load| format!("{:.1} %", load.percent())).collect();
    let torques = match proposal.torque_response {
        Some(_) => format!("torques within {} µs", response(proposal.torque_response)),
        None => "no bound for torques".to_owned(),
    };
    format!(
        "  {}: {}\n      load {}, up to {:.0} Hz, {torques}",
        changes.join(", "),
        if proposal.fits { "fits" } else { "does not fit" },
        loads.join(" and "),
        proposal.highest_hz,
    )
}

/// Returns the nodes of a frame by joint or node name.
pub(super) fn nodes(stream: &Stream, bus: &Bus) -> String {
    let member = |node| {
        let found = bus.members.iter().find(|member| member.plan.node == node);
        found.map(|member| short(&member.plan.name))
    };
    let names: Vec<&str> = stream.nodes.iter().filter_map(|node| member(*node)).collect();
    if names.is_empty() { "master".to_owned() } else { names.join("+") }
}

/// Returns `elbow` of `joint 3 (elbow)`.
fn short(name: &str) -> &str {
    let inside = name.split_once('(').and_then(|(_, rest)| rest.split_once(')'));
    inside.map_or(name, |(inside, _)| inside)
}

/// Returns the name of a frame's role.
pub(super) fn role(role: Role) -> String {
    match role {
        Role::Sync => "SYNC".into(),
        Role::Tpdo(number) => format!("TPDO{number}"),
        Role::Rpdo(number) => format!("RPDO{number}"),
        Role::Heartbeat => "heartbeat".into(),
        Role::Emergency => "EMCY".into(),
        Role::SdoRequest => "SDO request".into(),
        Role::SdoResponse => "SDO response".into(),
    }
}

fn pace(pace: Pace) -> String {
    match pace {
        Pace::Clock { period_us } => span(period_us),
        Pace::Change { gap_us, timer_us: Some(timer_us), .. } => {
            format!("{}; change ≥ {}", span(timer_us), span(gap_us))
        }
        Pace::Change { gap_us, timer_us: None, .. } => format!("change ≥ {}", span(gap_us)),
        Pace::Chance { gap_us } => format!("chance ≥ {}", span(gap_us)),
    }
}

/// Formats a time as `5 ms` or `1250 µs`.
fn span(us: u32) -> String {
    if us > 0 && us.is_multiple_of(1_000) {
        format!("{} ms", us / 1_000)
    } else {
        format!("{us} µs")
    }
}

/// Formats a response time in µs, rounded up; an unbounded one as `none`.
fn response(response: Option<Duration>) -> String {
    response.map_or_else(|| "none".into(), |bound| bound.as_nanos().div_ceil(1_000).to_string())
}

fn stage(stage: CycleStage, plan: &BusPlan, bus: &Bus, names: &Names) -> String {
    let frame = |cob_id: u16| {
        let found = plan.frames.iter().find(|frame| frame.stream.cob_id == cob_id);
        found.map_or_else(String::new, |frame| {
            let name = names.frame(plan, &frame.stream);
            // The table of frames lists the nodes of a shared frame.
            let is_shared = frame.stream.nodes.len() > 1;
            if is_shared { name } else { format!("{name} {}", nodes(&frame.stream, bus)) }
        })
    };
    match stage {
        CycleStage::Sync => "SYNC".into(),
        CycleStage::Drives => "drives sample".into(),
        CycleStage::Host => "host computes".into(),
        CycleStage::Tpdo(cob_id) | CycleStage::Rpdo(cob_id) => frame(cob_id),
    }
}
