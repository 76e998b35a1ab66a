//! Times of the steps of a cycle: percentiles, histograms, overruns.

use crate::html::{Cell, Html};
use crate::timing::NAMES;
use crate::view::View;
use crate::words::{count, counted};
use telemetry::manifest::SessionKind;

/// Writes the times.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    html.section("timing", "Timing");
    let timing = view.gathered.timing.as_ref().filter(|_| view.gathered.has_replay());
    let Some(timing) = timing else {
        html.missing(&view.without_replay("Times of the cycle\u{2019}s steps"));
        html.end_section();
        return;
    };
    let kind = view.subject.manifest.as_ref().map(|manifest| manifest.kind);
    if matches!(kind, Some(SessionKind::Demo | SessionKind::Campaign)) {
        html.paragraph(
            "In virtual time, computing takes no time: only what waits for the wire is measured.",
        );
    }
    let rows = NAMES.iter().zip(timing.percentiles()).map(|((name, about), (number, values))| {
        let mut row: Vec<Cell> =
            vec![format!("{name}: {about}").into(), Cell::Number(count(number))];
        let is_empty = number == 0;
        row.extend(values.map(|value| {
            Cell::Number(if is_empty { "\u{2013}".to_owned() } else { count(value) })
        }));
        row
    });
    let rows: Vec<Vec<Cell>> = rows.collect();
    let heads = ["Time in µs", "Cycles", "p50", "p99", "p99.9", "Greatest"];
    html.table("Percentiles over all cycles, each up to 1 % too large", &heads, &rows);
    for (place, (name, about)) in NAMES.iter().enumerate() {
        if let Some(histogram) = timing.histogram(place).filter(|_| timing.is_used(place)) {
            html.figure(|width| histogram.svg(width), &format!("{name}: time {about}, of all cycles. The axis of counts is logarithmic, so that single late cycles are seen."));
        }
    }
    let overruns = view.gathered.figures.overruns;
    html.paragraph(&match overruns {
        0 => "No cycle was over time.".to_owned(),
        overruns => format!(
            "{} over time: torques too late to be sent, or a skipped SYNC.",
            counted(overruns, "cycle")
        ),
    });
    html.end_section();
}
