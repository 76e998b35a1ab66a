//! Histograms with a logarithmic axis of counts, which shows rare values.

use std::ops::Range;

use crate::axis;
use crate::ink::{Canvas, PathData, width_of};
use crate::legend::ROW;

/// Edges around the bars, in px.
const LEFT: f64 = 54.0;
const RIGHT: f64 = 14.0;
const HEIGHT: f64 = 110.0;
const AXIS: f64 = 38.0;

/// Width of an interval between two values, in px.
const PITCH: f64 = 74.0;

/// Count of the values within a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Least value.
    pub from: f64,
    /// Greatest value.
    pub to: f64,
    /// Number of values.
    pub count: u64,
}

/// Bars over one axis, with named values.
#[derive(Clone, Debug)]
pub struct Histogram {
    /// Title, also the alternative text.
    pub title: String,
    /// Name of the values with their unit.
    pub axis: String,
    /// Intervals of the values, with their counts.
    pub bars: Vec<Bar>,
    /// Named values, as lines: percentiles, limits.
    pub marks: Vec<(String, f64)>,
}

impl Histogram {
    /// Draws the histogram in this width, in px.
    pub fn svg(&self, width: f64) -> String {
        let width = width.max(LEFT + RIGHT + 100.0);
        let values = self.range();
        let x = |value: f64| {
            let share = (value - values.start) / (values.end - values.start);
            LEFT + share.clamp(0.0, 1.0) * (width - LEFT - RIGHT)
        };
        let marks = self.placed(&x, width);
        let rows = marks.iter().map(|(row, ..)| row + 1.0).fold(0.0, f64::max);
        let top = 2.0 * ROW + rows * ROW;
        let bottom = top + HEIGHT;
        let decades = self.decades();
        let y = |count: f64| bottom - (count.log10() + 0.3) / (decades + 0.4) * HEIGHT;
        let mut canvas = Canvas::new(&self.title, width, bottom + AXIS);
        canvas.text("t", [LEFT, 14.0], &self.title);
        canvas.text("", [8.0, 14.0 + ROW], "count, logarithmic");
        let mut grid = PathData::default();
        for (count, text) in decade_ticks(decades) {
            grid.start([LEFT, y(count)]);
            grid.line([width - RIGHT, y(count)]);
            canvas.text("e", [LEFT - 6.0, y(count) + 4.0], &text);
        }
        canvas.path("g", &grid.finish());
        for bar in self.bars.iter().filter(|bar| bar.count > 0) {
            let (from, to) = (x(bar.from), x(bar.to));
            let count = f64::from(u32::try_from(bar.count).unwrap_or(u32::MAX));
            canvas.rect(
                "a s c0",
                [from, y(count)],
                [(to - from - 0.5).max(1.0), bottom - y(count)],
            );
        }
        let mut line = PathData::default();
        line.start([LEFT, bottom]);
        line.line([width - RIGHT, bottom]);
        for (value, text) in axis::ticks(&values, ((width - LEFT - RIGHT) / PITCH).max(2.0)) {
            line.start([x(value), bottom]);
            line.line([x(value), bottom + 4.0]);
            canvas.text("m", [x(value), bottom + 17.0], &text);
        }
        canvas.path("x", &line.finish());
        canvas.text("m", [LEFT + (width - LEFT - RIGHT) / 2.0, bottom + 33.0], &self.axis);
        let mut lines = PathData::default();
        for (row, at, class, name) in &marks {
            let above = 2.0 * ROW + row * ROW;
            lines.start([*at, above + 2.0]);
            lines.line([*at, bottom]);
            canvas.text(class, [*at + if *class == "vt" { 3.0 } else { -3.0 }, above + 12.0], name);
        }
        canvas.path("v", &lines.finish());
        canvas.finish()
    }

    /// Returns the range of the values, with margins for the first and the last bar.
    fn range(&self) -> Range<f64> {
        let bars = self.bars.iter().filter(|bar| bar.count > 0);
        let ends = bars.flat_map(|bar| [bar.from, bar.to]);
        let ends = ends.chain(self.marks.iter().map(|(_, value)| *value));
        axis::range(ends, false)
    }

    /// Returns the number of decades of the greatest count.
    fn decades(&self) -> f64 {
        let most = self.bars.iter().map(|bar| bar.count).max().unwrap_or(1).max(1);
        f64::from(u32::try_from(most).unwrap_or(u32::MAX)).log10().max(1.0)
    }

    /// Returns row, place, class and name of each mark; marks that would overlap are in different rows.
    fn placed(&self, x: &impl Fn(f64) -> f64, width: f64) -> Vec<(f64, f64, &'static str, &str)> {
        let mut marks: Vec<_> = self.marks.iter().filter(|(_, value)| value.is_finite()).collect();
        marks.sort_by(|(_, one), (_, other)| one.total_cmp(other));
        let (mut row, mut end) = (0.0, f64::NEG_INFINITY);
        let mut placed = Vec::new();
        for (name, value) in marks {
            let (at, length) = (x(*value), width_of(name) * 1.08 + 6.0);
            let is_left = at + length > width;
            let (from, to) = if is_left { (at - length, at) } else { (at, at + length) };
            if from < end {
                row += 1.0;
            }
            end = to;
            placed.push((row, at, if is_left { "vt e" } else { "vt" }, name.as_str()));
        }
        placed
    }
}

/// Returns the powers of ten up to this exponent.
fn decade_ticks(decades: f64) -> impl Iterator<Item = (f64, String)> {
    let powers = std::iter::successors(Some(1.0_f64), |power| Some(power * 10.0));
    powers.take_while(move |power| power.log10() <= decades + 0.1).map(|power| {
        let text =
            if power < 1e4 { format!("{power:.0}") } else { format!("1e{:.0}", power.log10()) };
        (power, text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_and_marks_are_drawn_and_empty_bars_are_not() {
        let bars = [(0.0, 1_000), (1.0, 0), (2.0, 1)];
        let bars = bars.map(|(from, count)| Bar { from, to: from + 1.0, count });
        let histogram = Histogram {
            title: "Time of a step".to_owned(),
            axis: "time in µs".to_owned(),
            bars: bars.to_vec(),
            marks: vec![("p99 2.5".to_owned(), 2.5), ("max 2.6".to_owned(), 2.6)],
        };
        let text = histogram.svg(400.0);
        assert_eq!(text.matches("<rect class=\"a s c0\"").count(), 2, "{text}");
        assert!(text.contains("p99 2.5") && text.contains(">1000<"), "{text}");
        assert!(!text.contains("NaN"), "{text}");
        assert!(
            !Histogram { bars: Vec::new(), marks: Vec::new(), ..histogram }
                .svg(1.0)
                .contains("NaN")
        );
    }
}
