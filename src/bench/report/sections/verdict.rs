//! Verdict: cause of a stop and the way out, or that nothing stopped the session. Each stop with its seconds, and the
//! modes.

use crate::html::{Cell, Html};
use crate::modes::{self, AFTER, BEFORE, Moment};
use crate::stops::{self, StopReport};
use crate::view::View;
use crate::words::{count, counted, moment};
use node::record::Mode;
use picture::strip::{Band, Curve, Event, Extent, Plot, Strip};
use telemetry::manifest::SessionKind;
use telemetry::way_out;

/// Writes whether the session was stopped, by what, and the way out.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    let last = view.stops.iter().rev().find(|stop| stop.ended.is_none());
    html.open("div", if last.is_some() { "verdict-box stopped" } else { "verdict-box" });
    html.section("verdict", if last.is_some() { "Stopped" } else { "Nothing stopped it" });
    match last {
        Some(stop) => stopped(html, view, stop),
        None => not_stopped(html, view),
    }
    html.end_section();
    html.close("div");
}

fn stopped(html: &mut Html, view: &View<'_>, stop: &StopReport) {
    html.element("p", "cause", &stop.cause);
    let [from, to, last] = &stop.modes;
    let mode = if to == last { to.clone() } else { format!("{to}, then {last}") };
    html.definitions(&[
        ("Joint", stop.joint.clone().unwrap_or_else(|| "none: not of one joint".to_owned())),
        ("Time", moment(stop.at)),
        ("Cycle", stop.cycle.map_or_else(|| "unknown".to_owned(), count)),
        ("Mode before", from.clone()),
        ("Mode since", mode),
    ]);
    html.paragraph(&format!("State: {}.", stops::state(last)));
    html.subheading("leave", "How to leave this state");
    let kind = view.subject.manifest.as_ref().map(|manifest| manifest.kind);
    if matches!(kind, Some(SessionKind::Demo | SessionKind::Campaign)) {
        html.paragraph("This was a simulation, which is over. On an arm:");
    }
    html.steps(&way_out::of_stop(stop.kind, stop.joint.as_deref(), &stop.not_off));
    html.advice("All causes with their reactions: `frhc explain faults`. Hazards and tests: docs/safety.md.");
}

fn not_stopped(html: &mut Html, view: &View<'_>) {
    let mode = view.gathered.modes.last().map(Mode::name);
    let before = match view.stops.len() {
        0 => String::new(),
        stops => format!(
            " {} before, each ended by a reset.",
            counted(u64::try_from(stops).unwrap_or(0), "stop")
        ),
    };
    match mode {
        Some(mode) => html.paragraph(&format!("The session ended in mode {mode}.{before}")),
        None => html.missing("No cycle could be read: there is nothing to show."),
    }
}

/// Writes the stops, each with the seconds around it.
pub(crate) fn stops(html: &mut Html, view: &View<'_>) {
    if view.stops.is_empty() {
        return;
    }
    html.section("stops", "Stops");
    let rows: Vec<Vec<Cell>> =
        (1..).zip(view.stops).map(|(number, stop)| row(number, stop)).collect();
    let heads =
        ["Stop", "Time", "Cycle", "From", "To", "Ended by a reset", "Cause", "Fault record"];
    html.table("Stops in the order of time; the numbers are those of the pictures", &heads, &rows);
    if view.gathered.modes.more_stops > 0 {
        html.missing(&format!("{} more are not listed.", count(view.gathered.modes.more_stops)));
    }
    for (number, stop) in (1..).zip(view.stops) {
        if stop.moments.len() > 1 {
            html.subheading(&format!("stop-{number}"), &format!("Stop {number}: {}", stop.cause));
            let picture = close_up(view, stop, number);
            html.figure(
                |width| picture.svg(width),
                &format!(
                    "{BEFORE:.0} s before stop {number} and {AFTER:.0} s after it. Time zero is the SYNC of its cycle. Place in the session: Modes over time, line {number}."
                ),
            );
        }
    }
    html.end_section();
}

fn row(number: usize, stop: &StopReport) -> Vec<Cell> {
    let [from, to, last] = &stop.modes;
    let heading = if stop.moments.len() > 1 {
        Cell::Link(format!("stop-{number}"), format!("Stop {number}"))
    } else {
        Cell::Link("modes".to_owned(), format!("Stop {number}"))
    };
    vec![
        heading,
        Cell::Number(moment(stop.at)),
        Cell::Number(stop.cycle.map_or_else(|| "\u{2013}".to_owned(), count)),
        from.as_str().into(),
        if to == last { to.as_str().into() } else { format!("{to}, then {last}").into() },
        stop.ended.map_or_else(|| "no".to_owned(), moment).into(),
        stop.cause.clone().into(),
        stop.record.as_ref().map_or_else(|| "none".into(), |name| Cell::Code(name.clone())),
    ]
}

/// Returns the seconds around a stop, with the positions and torques of its joint, or of all.
fn close_up(view: &View<'_>, stop: &StopReport, number: usize) -> Strip {
    let zero = stop.at;
    let mut strip =
        Strip::new(format!("Seconds around stop {number}: {}", stop.cause), -BEFORE..AFTER);
    let [first, last] =
        [stop.moments.first(), stop.moments.last()].map(|of| of.map_or(0.0, |of| of.at - zero));
    strip.time = first.max(-BEFORE)..last.max(first + 1e-3);
    let mut bands: Vec<Band> = Vec::new();
    for one in &stop.moments {
        match bands.last_mut() {
            Some(band) if band.name == one.mode.name() => band.to = one.at - zero,
            last => {
                last.into_iter().for_each(|band| band.to = one.at - zero);
                let (from, to) = (one.at - zero, one.at - zero);
                let (name, colour) = (one.mode.name().to_owned(), modes::colour(one.mode));
                bands.push(Band { from, to, name, colour });
            }
        }
    }
    strip.bands = bands;
    strip.events = vec![Event { at: 0.0, name: format!("stop {number}") }];
    let joint = stop.joint.as_ref().and_then(|name| view.joints.iter().position(|one| one == name));
    let units = view.units();
    let curves = |of: &dyn Fn(&Moment, usize) -> Option<f64>| -> Vec<Curve> {
        let all =
            units.iter().enumerate().filter(|(place, _)| joint.is_none_or(|joint| joint == *place));
        let curves = all.map(|(place, (name, ..))| curve(stop, zero, name, |one| of(one, place)));
        curves.collect()
    };
    let named = |what: &str| match &stop.joint {
        Some(joint) => format!("{what} of {joint}"),
        None => format!("{what} of all joints"),
    };
    let unit = |place: usize| units.get(place).copied().unwrap_or(("", "", ""));
    let (_, position, torque) = unit(joint.unwrap_or(0));
    if stop.moments.iter().any(|one| one.q.is_some()) {
        let curves = curves(&|one, place| one.q?.get(place).copied());
        let plot = Plot::new(named("position"), position, curves);
        strip.plots.push(Plot { has_zero: false, ..plot });
    }
    if stop.moments.iter().any(|one| one.tau.is_some()) {
        let curves = curves(&|one, place| one.tau?.get(place).copied());
        strip.plots.push(Plot::new(named("commanded torque"), torque, curves));
    }
    let force = curve(stop, zero, "force", |one| Some(one.force));
    strip.plots.push(Plot { height: 60.0, ..Plot::new("force sensed", "N", [force]) });
    let missing = curve(stop, zero, "missing", |one| Some(f64::from(one.missing)));
    strip.plots.push(Plot { height: 44.0, ..Plot::new("joints without a sample", "", [missing]) });
    strip
}

/// Returns a curve of the moments: each value until the next one.
fn curve(stop: &StopReport, zero: f64, name: &str, of: impl Fn(&Moment) -> Option<f64>) -> Curve {
    let next = stop.moments.iter().skip(1).map(Some).chain([None]);
    let extents = stop.moments.iter().zip(next).map(|(one, next)| {
        let value = of(one).unwrap_or(f64::NAN);
        let to = next.map_or(one.at, |next| next.at);
        Extent { from: one.at - zero, to: to - zero, min: value, max: value }
    });
    Curve::new(name, extents)
}

/// Writes the modes over time.
pub(crate) fn timeline(html: &mut Html, view: &View<'_>) {
    html.section("modes", "Modes over time");
    let missing = view.gathered.missing.curve(0, "missing", 1.0, 0.0);
    let force = view.gathered.forces.curve(0, "force", 1.0, 0.0);
    let plots = [
        Plot { height: 60.0, ..Plot::new("force sensed", "N", [force]) },
        Plot { height: 40.0, ..Plot::new("joints without a sample", "", [missing]) },
    ];
    let picture = view.strip(&format!("Modes over time: {}", spells(view)), plots);
    html.figure(
        |width| picture.svg(width),
        "Modes of the node, with a line for each stop. Blue: it works, darker the more it does; yellow, orange, red: stopped, S1 to S3.",
    );
    let rows = Mode::ALL.into_iter().filter_map(|mode| {
        let seconds = view.gathered.modes.seconds_in(mode);
        let spells = view.gathered.modes.spells.iter().filter(|spell| spell.mode == mode).count();
        let first = view.gathered.modes.first(mode)?;
        Some(vec![
            mode.name().into(),
            Cell::Number(crate::words::duration(seconds)),
            Cell::Number(count(u64::try_from(spells).unwrap_or(0))),
            Cell::Number(moment(first)),
        ])
    });
    let rows: Vec<Vec<Cell>> = rows.collect();
    html.table("Time in each mode", &["Mode", "Time", "Times entered", "First"], &rows);
    let more = view.gathered.modes.more_spells;
    if more > 0 {
        html.missing(&format!(
            "The mode changes {} more times than the picture and this table have.",
            count(more)
        ));
    }
    html.end_section();
}

/// Returns the first changes of the mode in words, for those who do not see the picture.
fn spells(view: &View<'_>) -> String {
    let spells = view.gathered.modes.spells.iter().take(12);
    let texts = spells.map(|spell| format!("{} from {:.1} s", spell.mode.name(), spell.from));
    texts.collect::<Vec<_>>().join(", ")
}
