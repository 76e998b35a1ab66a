//! Load of each bus over time.

use serde_json::Value;

use crate::html::{Cell, Html};
use crate::view::View;
use crate::words::{count, number};
use picture::strip::Plot;

/// Writes the loads.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    html.section("load", "Bus load");
    let interfaces = view.subject.interfaces();
    if view.gathered.figures.loads.is_empty() || view.subject.config.is_none() {
        html.missing("The load needs the bit rates of a configuration: give --config FILE.");
        html.end_section();
        return;
    }
    let plots = interfaces.iter().enumerate().map(|(place, name)| {
        Plot::new(name, "% of the bit rate", [view.gathered.loads.curve(place, name, 1.0, 0.0)])
    });
    let picture = view.strip("Load of each bus over time", plots);
    html.figure(
        |width| picture.svg(width),
        "Load of each bus in each cycle, with stuff bits and the space between frames. Cycles of a boot have more than their share: SDO.",
    );
    let frames = view.subject.summary.as_ref().and_then(|summary| summary.get("bus_frames"));
    let frames = |place: usize| frames?.get(place).and_then(Value::as_u64);
    let rows = interfaces.iter().zip(&view.gathered.figures.loads).enumerate();
    let rows = rows.map(|(place, (name, load))| {
        vec![
            Cell::Code(name.clone()),
            Cell::Number(number(load.mean())),
            Cell::Number(number(load.greatest)),
            Cell::Number(frames(place).map_or_else(|| "\u{2013}".to_owned(), count)),
        ]
    });
    let rows: Vec<Vec<Cell>> = rows.collect();
    let heads = ["Bus", "Mean in %", "Greatest second in %", "Frames"];
    html.table("Load since the first cycle", &heads, &rows);
    html.end_section();
}
