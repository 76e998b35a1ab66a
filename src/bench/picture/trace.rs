//! Drawing of a curve: the area between its extremes, and a line in the middle.

use std::ops::Range;

use crate::curve::{Curve, Extent};
use crate::ink::{Canvas, PathData};

/// Minimum distance of the extremes for a visible area between them, in px.
const VISIBLE: f64 = 1.2;

/// Points of a part: x, low, high, in px.
type Part = Vec<[f64; 3]>;

/// Axes on the picture.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// Time, in s.
    pub(crate) time: Range<f64>,
    /// Range between the horizontal edges, in the unit of the plot.
    pub(crate) values: Range<f64>,
    /// Left, top, right and bottom edges, in px.
    pub(crate) edges: [f64; 4],
}

impl Frame {
    /// Returns the horizontal position of a time.
    pub(crate) fn x(&self, time: f64) -> f64 {
        let [left, _, right, _] = self.edges;
        let share = (time - self.time.start) / (self.time.end - self.time.start);
        left + share * (right - left)
    }

    /// Returns the vertical position of a value, from the top.
    pub(crate) fn y(&self, value: f64) -> f64 {
        let [_, top, _, bottom] = self.edges;
        let share = (value - self.values.start) / (self.values.end - self.values.start);
        bottom - share * (bottom - top)
    }
}

/// Draws a curve: areas first, then its line.
pub(crate) fn draw(canvas: &mut Canvas, frame: &Frame, curve: &Curve) {
    let (mut area, mut line) = (PathData::default(), PathData::default());
    for part in parts(frame, &curve.extents) {
        if part.iter().any(|[_, low, high]| low - high > VISIBLE) {
            part.iter().for_each(|[x, _, high]| area.line([*x, *high]));
            part.iter().rev().for_each(|[x, low, _]| area.line([*x, *low]));
            area.close();
        }
        part.iter().for_each(|[x, low, high]| line.line([*x, (low + high) / 2.0]));
        line.lift();
    }
    let colour = curve.colour;
    canvas.path(&format!("a c{colour}"), &area.finish());
    canvas.path(&format!("l c{colour}"), &line.finish());
}

/// Returns the contiguous parts of a curve; extents in the same column of pixels are merged.
fn parts(frame: &Frame, extents: &[Extent]) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut part: Part = Vec::new();
    let mut last: Option<&Extent> = None;
    let within = |extent: &&Extent| extent.to >= frame.time.start && extent.from <= frame.time.end;
    for extent in extents.iter().filter(within) {
        let gap = last.map_or(0.0, |last| extent.from - last.to);
        let is_apart = gap > 0.5 * (extent.to - extent.from) + 1e-9 * extent.to.abs();
        if is_apart || !(extent.min.is_finite() && extent.max.is_finite()) {
            parts.push(std::mem::take(&mut part));
        }
        last = Some(extent);
        if !(extent.min.is_finite() && extent.max.is_finite()) {
            continue;
        }
        let [left, _, right, _] = frame.edges;
        let x = frame.x((extent.from + extent.to) / 2.0).clamp(left, right);
        let (low, high) = (frame.y(extent.min), frame.y(extent.max));
        if part.is_empty() {
            part.push([frame.x(extent.from).clamp(left, right), low, high]);
        }
        match part.last_mut() {
            Some([at, lowest, highest]) if x - *at < 0.8 => {
                (*lowest, *highest) = (lowest.max(low), highest.min(high));
            }
            _ => part.push([x, low, high]),
        }
    }
    parts.push(part);
    parts.retain(|part| !part.is_empty());
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        Frame { time: 0.0..10.0, values: -1.0..1.0, edges: [0.0, 0.0, 100.0, 100.0] }
    }

    fn extents(values: impl IntoIterator<Item = f64>) -> Vec<Extent> {
        let from = std::iter::successors(Some(0.0), |from| Some(from + 1.0));
        let extent = |(from, value)| Extent { from, to: from + 1.0, min: value, max: value };
        from.zip(values).map(extent).collect()
    }

    #[test]
    fn nan_and_missing_times_are_gaps() {
        assert_eq!(parts(&frame(), &extents([0.0, 0.5, f64::NAN, 0.5, 0.0])).len(), 2);
        let mut apart = extents([0.0, 0.5, 0.1]);
        apart[2].from = 5.0;
        apart[2].to = 6.0;
        assert_eq!(parts(&frame(), &apart).len(), 2);
        assert_eq!(parts(&frame(), &extents([f64::NAN])), Vec::<Part>::new());
    }

    #[test]
    fn extents_of_a_column_keep_their_extremes() {
        let step = 0.01;
        let one = |at: u32| {
            let from = f64::from(at) * step;
            let max = if at == 77 { 0.9 } else { 0.0 };
            Extent { from, to: from + step, min: 0.0, max }
        };
        let all: Vec<Extent> = (0..1_000).map(one).collect();
        let [part] = &parts(&frame(), &all)[..] else { panic!("one part") };
        assert!(part.len() < 130, "{}", part.len());
        let highest = part.iter().map(|[_, _, high]| *high).fold(f64::INFINITY, f64::min);
        assert!((highest - 5.0).abs() < 1e-9, "{highest}");
    }
}
