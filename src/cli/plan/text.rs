//! A plan for people: a screen or two a bus.

use std::fmt::Write;
use std::time::Duration;

use crate::canopen::load::network::BusPlan;
use crate::canopen::load::network::Network;
use crate::canopen::load::network::Planned;
use crate::canopen::load::pace::Pace;
use crate::canopen::load::proposals::Proposal;
use crate::canopen::load::streams::Role;
use crate::canopen::load::streams::Stream;
use crate::canopen::load::timeline::Stage;
use crate::canopen::load::timeline::Step;
use crate::canopen::load::utilisation::BusLoad;
use crate::cli::plan::Report;
use crate::cli::plan::obstacle;

/// Columns of the cycle's picture.
const COLUMNS: u32 = 50;

/// The whole report, without a line end behind it.
pub(super) fn of(report: &Report<'_>) -> String {
    let mut lines = vec![head(report)];
    for bus in &report.buses {
        lines.push(String::new());
        lines.extend(bus_lines(bus, report));
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
    let pauses = report.assumed.pauses;
    let errors = report
        .assumed
        .error_gap_us
        .map_or_else(String::new, |gap| format!(", an error on the wire every {}", span(gap)));
    format!(
        "SYNC every {}, {:.0} Hz; assumed: drives answer after {} µs, the host after {} µs, of each \
         node an\nemergency every {}, an SDO exchange every {}{errors}",
        span(period_us),
        1e6 / f64::from(period_us.max(1)),
        pauses.drive_us,
        pauses.host_us,
        span(report.assumed.emergency_gap_us),
        span(report.assumed.sdo_gap_us),
    )
}

fn bus_lines(bus: &BusPlan, report: &Report<'_>) -> Vec<String> {
    let verdict = if bus.fits() { "fits" } else { "does not fit" };
    let mut lines = vec![format!("bus {}, {} bit/s: {verdict}", bus.name, bus.bitrate)];
    lines.extend(load_lines(bus));
    lines.push(String::new());
    lines.extend(frame_lines(bus, report.network));
    lines.push(String::new());
    lines.extend(cycle_lines(bus, report.network));
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
    vec![
        line("SYNC and its PDOs, unstuffed", &all.cycle_least, "a cycle"),
        line("SYNC and its PDOs, worst case", &all.cycle_worst, ""),
        line("all that is planned, unstuffed", &all.least, ""),
        line("all that goes on, typically", &all.typical, ""),
        line("all that is planned, worst case", &all.worst, &limit),
        line("with all values changing", &all.busiest, "as often as inhibit times allow"),
        line("with emergencies and SDO", &all.with_chance, ""),
        format!(
            "  left                              {:>9.1} kbit/s, {:.0} expedited SDO/s",
            bus.margin.bits_per_s / 1e3,
            bus.margin.expedited_sdo_per_s
        ),
        format!(
            "  highest rate                      {:>9.0} Hz worst case, {:.0} Hz typically \
             (load {:.0}, {:.0}; cycle {:.0}, {:.0})",
            rates.worst.highest_hz(),
            rates.typical.highest_hz(),
            rates.worst.load_hz,
            rates.typical.load_hz,
            rates.worst.cycle_hz,
            rates.typical.cycle_hz
        ),
    ]
}

fn frame_lines(bus: &BusPlan, network: &Network) -> Vec<String> {
    let head = format!(
        "  {:<4} {:<9} {:<25} {:>5} {:>5} {:>6} {:>5}  {:<18} {:>8}",
        "id", "frame", "of", "bytes", "least", "typ", "most", "every", "response"
    );
    let line = |frame: &Planned| {
        let stream = &frame.stream;
        let late = if frame.is_late() { " late" } else { "" };
        let mut of = nodes(stream, network);
        if of.chars().count() > 25 {
            of = of.chars().take(24).chain(['…']).collect();
        }
        format!(
            "  {:03X}  {:<9} {of:<25} {:>5} {:>5} {:>6.1} {:>5}  {:<18} {:>8}{late}",
            stream.cob_id,
            role(stream.role),
            stream.bytes,
            stream.least_bits(),
            frame.typical_bits,
            stream.worst_bits(),
            pace(stream.pace),
            response(frame.response),
        )
    };
    let mut lines = vec![head];
    lines.extend(bus.frames.iter().map(line));
    lines
}

fn cycle_lines(bus: &BusPlan, network: &Network) -> Vec<String> {
    let (worst, typical) = (&bus.timeline.worst, &bus.timeline.typical);
    let period_us = f64::from(network.period_us);
    let width_us = worst.done_us.max(period_us);
    let mut lines = vec![format!(
        "  a cycle, in µs                     worst case      typically  0 {:>49}",
        format!("{width_us:.0}")
    )];
    for (step, usual) in worst.steps.iter().zip(&typical.steps) {
        lines.push(format!(
            "  {:<30}{:>7.0}-{:<6.0} {:>7.0}-{:<6.0} {}",
            stage(step.stage, bus, network),
            step.start_us,
            step.end_us,
            usual.start_us,
            usual.end_us,
            bar(step, width_us),
        ));
    }
    let delay = &bus.loop_delay;
    lines.push(format!(
        "  {:<30}{:>14.0} {:>14.0} if other frames use every pause of the wire",
        "done", worst.blocked_us, typical.blocked_us
    ));
    lines.push(format!(
        "  {:<30}{:>14.0} {:>14.0} synchronous RPDO: acts at a SYNC, all at once",
        "position to torque", delay.worst.synchronous_us, delay.typical.synchronous_us
    ));
    let arrivals = |first: f64, last: f64| format!("{first:.0}-{last:.0}");
    lines.push(format!(
        "  {:<30}{:>14} {:>14} event-driven RPDO: acts as it comes, joint by joint",
        "",
        arrivals(delay.worst.first_arrival_us, delay.worst.last_arrival_us),
        arrivals(delay.typical.first_arrival_us, delay.typical.last_arrival_us)
    ));
    lines
}

/// Filled where the wire is in use, dotted where it waits.
fn bar(step: &Step, width_us: f64) -> String {
    let mark = match step.stage {
        Stage::Drives | Stage::Host => '·',
        Stage::Sync | Stage::Tpdo(_) | Stage::Rpdo(_) => '█',
    };
    let column_us = width_us / f64::from(COLUMNS);
    let place = |column: u32| (f64::from(column) + 0.5) * column_us;
    let is_in = |column: u32| step.start_us <= place(column) && place(column) < step.end_us;
    let line: String = (0..COLUMNS).map(|column| if is_in(column) { mark } else { ' ' }).collect();
    line.trim_end().to_owned()
}

fn proposal_lines(report: &Report<'_>) -> Vec<String> {
    let is_overloaded = !report.buses.iter().all(BusPlan::fits);
    let mut lines = Vec::new();
    if !report.proposals.is_empty() {
        let why = if is_overloaded { "what could be done" } else { "what would be quicker" };
        lines.push(format!("{why}, each computed in the worst case:"));
    }
    lines.extend(report.proposals.iter().map(proposal));
    if is_overloaded {
        lines.extend(report.obstacles.iter().map(|it| format!("  {}", obstacle(it))));
    }
    lines
}

fn proposal(proposal: &Proposal) -> String {
    let changes: Vec<String> = proposal.changes.iter().map(ToString::to_string).collect();
    let loads: Vec<String> =
        proposal.loads.iter().map(|load| format!("{:.1} %", load.percent())).collect();
    let mut text = String::new();
    let verdict = if proposal.fits { "fits" } else { "does not fit" };
    write!(
        text,
        "  {}: {verdict}\n      load {}, up to {:.0} Hz, torques within {} µs",
        changes.join(", "),
        loads.join(" and "),
        proposal.highest_hz,
        response(proposal.torque_response)
    )
    .ok();
    text
}

/// Whose a frame is: the joints' names, or the nodes'.
pub(super) fn nodes(stream: &Stream, network: &Network) -> String {
    let member = |node| {
        let mut members = network.buses.iter().flat_map(|bus| &bus.members);
        // Node-ids are unique on a bus only, and the frame's bus is where its COB-ID is planned.
        members.find(|member| member.plan.node == node).map(|member| short(&member.plan.name))
    };
    let names: Vec<String> = stream.nodes.iter().filter_map(|node| member(*node)).collect();
    if names.is_empty() { "master".to_owned() } else { names.join("+") }
}

/// `elbow` of `joint 3 (elbow)`.
fn short(name: &str) -> String {
    let inside = name.split_once('(').and_then(|(_, rest)| rest.split_once(')'));
    inside.map_or(name, |(inside, _)| inside).to_owned()
}

/// What a frame is, in words.
pub(super) fn role(role: Role) -> String {
    match role {
        Role::Sync => "SYNC".into(),
        Role::Tpdo(number) => format!("TPDO{number}"),
        Role::Rpdo(number) => format!("RPDO{number}"),
        Role::Heartbeat => "heartbeat".into(),
        Role::Emergency => "EMCY".into(),
        Role::SdoRequest => "SDO ask".into(),
        Role::SdoResponse => "SDO reply".into(),
    }
}

fn pace(pace: Pace) -> String {
    match pace {
        Pace::Clock { period_us } => span(period_us),
        Pace::Change { gap_us, timer_us: Some(timer_us), .. } => {
            format!("{}, change {}", span(timer_us), span(gap_us))
        }
        Pace::Change { gap_us, timer_us: None, .. } => format!("change {}", span(gap_us)),
        Pace::Chance { gap_us } => format!("chance {}", span(gap_us)),
    }
}

/// `5 ms`, `1250 µs`.
fn span(us: u32) -> String {
    if us % 1_000 == 0 && us > 0 { format!("{} ms", us / 1_000) } else { format!("{us} µs") }
}

/// Whole µs, rounded up: it is a bound.
fn response(response: Option<Duration>) -> String {
    response.map_or_else(|| "none".into(), |bound| bound.as_nanos().div_ceil(1_000).to_string())
}

fn stage(stage: Stage, bus: &BusPlan, network: &Network) -> String {
    let frame = |cob_id: u16| {
        let found = bus.frames.iter().find(|frame| frame.stream.cob_id == cob_id);
        found.map_or_else(String::new, |frame| {
            format!("{} {}", role(frame.stream.role), nodes(&frame.stream, network))
        })
    };
    match stage {
        Stage::Sync => "SYNC".into(),
        Stage::Drives => "drives sample".into(),
        Stage::Host => "host computes".into(),
        Stage::Tpdo(cob_id) | Stage::Rpdo(cob_id) => frame(cob_id),
    }
}
