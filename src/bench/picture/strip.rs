//! Time series in stacked plots with a common time axis, the modes above them, and events as lines through all plots.

use std::ops::Range;

use crate::axis;
pub use crate::curve::{Curve, Extent};
use crate::ink::{Canvas, PathData, width_of};
use crate::legend::{Legend, ROW};
use crate::theme::COLOURS;
use crate::trace::{self, Frame};

/// Space for the values at the left, and at the right end, in px.
const LEFT: f64 = 54.0;
const RIGHT: f64 = 14.0;

/// Height of the bar of modes, in px.
const BAND: f64 = 20.0;

/// Height of the axis of time with its name, in px.
const AXIS: f64 = 36.0;

/// Maximum number of rows of events; an event without space has a line but no name.
const MAX_ROWS: usize = 4;

/// Width of an interval between two times and the height of one between two values, in px.
const TIME_PITCH: f64 = 84.0;
const VALUE_PITCH: f64 = 26.0;

/// Curves between two axes.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Heading above the plot.
    pub title: String,
    /// Unit of the values.
    pub unit: String,
    /// Curves, in the order of drawing.
    pub curves: Vec<Curve>,
    /// Set if the axis of values contains zero.
    pub has_zero: bool,
    /// Height between the axes, in px.
    pub height: f64,
}

impl Plot {
    /// Creates a plot whose axis contains zero.
    pub fn new(
        title: impl Into<String>,
        unit: impl Into<String>,
        curves: impl IntoIterator<Item = Curve>,
    ) -> Self {
        let mut curves: Vec<Curve> = curves.into_iter().collect();
        for (place, curve) in curves.iter_mut().enumerate() {
            curve.colour = place % COLOURS;
        }
        Self { title: title.into(), unit: unit.into(), curves, has_zero: true, height: 84.0 }
    }

    /// Title with the unit.
    fn heading(&self) -> String {
        let separator = if self.title.is_empty() || self.unit.is_empty() { "" } else { " in " };
        format!("{}{separator}{}", self.title, self.unit)
    }

    fn legend<'a>(&'a self, heading: &'a str, width: f64) -> Legend<'a> {
        let is_named = self.curves.len() > 1;
        let entries = self.curves.iter().filter(|_| is_named);
        Legend::new(heading, entries.map(|curve| (curve.name.as_str(), curve.colour)), width)
    }
}

/// State between two times, as a bar.
#[derive(Clone, Debug)]
pub struct Band {
    /// Start, in s.
    pub from: f64,
    /// End, in s.
    pub to: f64,
    /// Name; drawn as its first letter if space is short.
    pub name: String,
    /// Number of the colour, 0 to 6: grey, three blues, yellow, orange, red.
    pub colour: usize,
}

/// Event, drawn as a line through all plots.
#[derive(Clone, Debug)]
pub struct Event {
    /// Time, in s.
    pub at: f64,
    /// Name above the plots.
    pub name: String,
}

/// Name of an event with its position: row from below, line, class with colour and anchor.
#[derive(Debug)]
struct Label<'a> {
    row: usize,
    x: f64,
    class: &'static str,
    name: &'a str,
}

/// Plots with a common time axis.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Alternative text; not drawn.
    pub title: String,
    /// Time, in s.
    pub time: Range<f64>,
    /// Bars above the plots.
    pub bands: Vec<Band>,
    /// Named lines through all plots.
    pub events: Vec<Event>,
    /// Plots, from the top.
    pub plots: Vec<Plot>,
}

impl Strip {
    /// Creates a picture of this time without plots.
    pub fn new(title: impl Into<String>, time: Range<f64>) -> Self {
        let (bands, events, plots) = (Vec::new(), Vec::new(), Vec::new());
        let is_long = time.end > time.start;
        let time = if is_long { time } else { time.start..time.start + 1.0 };
        Self { title: title.into(), time, bands, events, plots }
    }

    /// Draws the picture in this width, in px; the contents define its height.
    pub fn svg(&self, width: f64) -> String {
        let width = width.max(LEFT + RIGHT + 100.0);
        let frame = Frame {
            time: self.time.clone(),
            values: 0.0..1.0,
            edges: [LEFT, 0.0, width - RIGHT, 1.0],
        };
        let labels = self.labels(&frame);
        let rows = labels.iter().map(|label| label.row + 1).max().unwrap_or(0);
        let bands_top = 6.0 + f64::from(u32::try_from(rows).unwrap_or(0)) * ROW;
        let plots_top = bands_top + if self.bands.is_empty() { 0.0 } else { BAND + 6.0 };
        let inner = width - RIGHT - LEFT;
        let headings: Vec<String> = self.plots.iter().map(Plot::heading).collect();
        let legends = self.plots.iter().zip(&headings);
        let legends: Vec<_> = legends.map(|(plot, heading)| plot.legend(heading, inner)).collect();
        let taken = self.plots.iter().zip(&legends);
        let plots_height: f64 =
            taken.map(|(plot, legend)| legend.height() + plot.height + 10.0).sum();
        let bottom = plots_top + plots_height;
        let mut canvas = Canvas::new(&self.title, width, bottom + AXIS);
        let mut top = plots_top;
        let mut places =
            vec![[bands_top - 2.0, plots_top - if self.bands.is_empty() { 0.0 } else { 4.0 }]];
        for (plot, legend) in self.plots.iter().zip(&legends) {
            legend.draw(&mut canvas, [LEFT, top]);
            top += legend.height() + 3.0;
            let edges = [LEFT, top, width - RIGHT, top + plot.height];
            self.plot(&mut canvas, plot, Frame { edges, ..frame.clone() });
            places.push([top, top + plot.height]);
            top += plot.height + 7.0;
        }
        self.bars(&mut canvas, &frame, bands_top);
        self.axis(&mut canvas, &frame, bottom);
        self.marks(&mut canvas, &frame, &labels, &places);
        canvas.finish()
    }

    /// Draws a plot with its axes.
    fn plot(&self, canvas: &mut Canvas, plot: &Plot, frame: Frame) {
        let extents = plot.curves.iter().flat_map(|curve| &curve.extents);
        let ends = extents.flat_map(|extent| [extent.min, extent.max]);
        let frame = Frame { values: axis::range(ends, plot.has_zero), ..frame };
        let [left, top, right, bottom] = frame.edges;
        let (mut grid, mut zero) = (PathData::default(), PathData::default());
        for (value, text) in axis::ticks(&frame.values, (plot.height / VALUE_PITCH).max(3.0)) {
            let y = frame.y(value);
            let line = if value.abs() < f64::MIN_POSITIVE { &mut zero } else { &mut grid };
            line.start([left, y]);
            line.line([right, y]);
            canvas.text("e", [left - 6.0, y + 4.0], &text);
        }
        for (time, _) in self.times(&frame).0 {
            grid.start([frame.x(time), top]);
            grid.line([frame.x(time), bottom]);
        }
        canvas.path("g", &grid.finish());
        canvas.path("z", &zero.finish());
        for curve in &plot.curves {
            trace::draw(canvas, &frame, curve);
        }
    }

    fn times(&self, frame: &Frame) -> (Vec<(f64, String)>, &'static str) {
        let [left, _, right, _] = frame.edges;
        axis::times(&self.time, ((right - left) / TIME_PITCH).max(2.0))
    }

    /// Draws the time axis.
    fn axis(&self, canvas: &mut Canvas, frame: &Frame, y: f64) {
        let [left, _, right, _] = frame.edges;
        let (times, name) = self.times(frame);
        let mut line = PathData::default();
        line.start([left, y - 5.0]);
        line.line([right, y - 5.0]);
        for (time, text) in times {
            line.start([frame.x(time), y - 5.0]);
            line.line([frame.x(time), y - 1.0]);
            canvas.text("m", [frame.x(time), y + 11.0], &text);
        }
        canvas.path("x", &line.finish());
        canvas.text("m", [(left + right) / 2.0, y + 28.0], name);
    }

    /// Draws the bars of states.
    fn bars(&self, canvas: &mut Canvas, frame: &Frame, y: f64) {
        let [left, _, right, _] = frame.edges;
        for band in &self.bands {
            let from = frame.x(band.from).clamp(left, right);
            let length = frame.x(band.to).clamp(left, right) - from;
            if length.is_nan() || length <= 0.0 {
                continue;
            }
            let class = format!("b{}", band.colour);
            canvas.rect(&class, [from, y], [length.max(1.0), BAND]);
            let first = band.name.chars().next().map(String::from).unwrap_or_default();
            let names = [band.name.as_str(), first.as_str()];
            if let Some(name) = names.into_iter().find(|name| width_of(name) + 4.0 < length) {
                let middle = [from + length / 2.0, y + 14.0];
                canvas.text(&format!("bt m {class}"), middle, name);
            }
        }
    }

    /// Returns the names of the events for which there is space.
    fn labels(&self, frame: &Frame) -> Vec<Label<'_>> {
        let [left, _, right, _] = frame.edges;
        let mut taken: Vec<Vec<[f64; 2]>> = vec![Vec::new(); MAX_ROWS];
        let mut labels = Vec::new();
        for event in self.events.iter().filter(|event| self.time_has(event.at)) {
            let (x, width) = (frame.x(event.at), width_of(&event.name) * 1.08);
            let sides = [(x + 4.0, x + width, "vt"), (x - width, x - 4.0, "vt e")];
            let fits = sides.into_iter().find_map(|(from, to, class)| {
                if from < left - LEFT || to > right + RIGHT {
                    return None;
                }
                let is_free = |row: &Vec<[f64; 2]>| {
                    row.iter().all(|[other, end]| to + 6.0 < *other || *end + 6.0 < from)
                };
                let row = taken.iter().position(is_free)?;
                Some((row, from, to, class))
            });
            if let Some((row, from, to, class)) = fits {
                taken.get_mut(row).into_iter().for_each(|row| row.push([from, to]));
                labels.push(Label { row, x, class, name: event.name.as_str() });
            }
        }
        labels
    }

    /// Draws the names of the events, and their lines through the bars and each plot.
    fn marks(&self, canvas: &mut Canvas, frame: &Frame, labels: &[Label<'_>], places: &[[f64; 2]]) {
        let mut lines = PathData::default();
        for event in self.events.iter().filter(|event| self.time_has(event.at)) {
            for [top, bottom] in places {
                lines.start([frame.x(event.at), *top]);
                lines.line([frame.x(event.at), *bottom]);
            }
        }
        let rows = labels.iter().map(|label| label.row).max().unwrap_or(0);
        let end = places.first().map_or(0.0, |[top, _]| *top);
        for Label { row, x, class, name } in labels {
            let y = 15.0 + f64::from(u32::try_from(rows - row).unwrap_or(0)) * ROW;
            let beside = if *class == "vt" { 4.0 } else { -4.0 };
            canvas.text(class, [x + beside, y], name);
            lines.start([*x, y - 10.0]);
            lines.line([*x, end]);
        }
        canvas.path("v", &lines.finish());
    }

    fn time_has(&self, at: f64) -> bool {
        (self.time.start..=self.time.end).contains(&at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Strip {
        let wave = (0..100).map(|at| {
            let from = f64::from(at) * 0.1;
            Extent { from, to: from + 0.1, min: from - 1.0, max: from }
        });
        let mut strip = Strip::new("<felt>", 0.0..10.0);
        strip.plots.push(Plot::new(
            "force",
            "N",
            [Curve::new("a<b", wave.clone()), Curve::new("c", wave)],
        ));
        strip.bands.push(Band { from: 0.0, to: 9.0, name: "engaged".to_owned(), colour: 3 });
        strip.bands.push(Band { from: 9.0, to: 9.5, name: "drives-off".to_owned(), colour: 6 });
        strip.events.push(Event { at: 9.0, name: "unplugged".to_owned() });
        strip
    }

    #[test]
    fn names_of_curves_bands_and_events_are_escaped_and_drawn() {
        let text = sample().svg(900.0);
        for part in [
            "aria-label=\"&lt;felt&gt;\"",
            "a&lt;b",
            ">engaged<",
            ">d<",
            ">unplugged<",
            "force in N",
            "time in s",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }

    #[test]
    fn events_at_one_time_have_rows_of_their_own() {
        let mut strip = sample();
        strip.events = (0..9).map(|_| Event { at: 5.0, name: "lost".to_owned() }).collect();
        let frame = Frame { time: 0.0..10.0, values: 0.0..1.0, edges: [54.0, 0.0, 886.0, 1.0] };
        let rows: Vec<usize> = strip.labels(&frame).iter().map(|label| label.row).collect();
        // At the right of their lines, then at the left.
        assert_eq!(rows, [0, 1, 2, 3, 0, 1, 2, 3]);
    }

    #[test]
    fn strip_without_curves_or_time_is_drawn() {
        let text = Strip::new("empty", 3.0..3.0).svg(10.0);
        assert!(text.ends_with("</svg>") && !text.contains("NaN"), "{text}");
    }
}
