//! Line charts as SVG text that stands alone: two axes through a frame, lines, bands and marks.
//!
//! Dark on white, for a screen or a printed page. What is drawn is
//! [`torque_plot`](crate::telemetry::torque_plot)'s choice.

use std::fmt::Write;

/// The whole picture, in px.
const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 620.0;
/// The frame of the axes, in px.
const LEFT: f64 = 92.0;
const RIGHT: f64 = 834.0;
const TOP: f64 = 74.0;
const BOTTOM: f64 = 548.0;
/// About so many ticks on an axis.
const TICKS: f64 = 9.0;

const STYLE: &str = "text{font-family:Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;\
font-size:14px;fill:#222}.title{font-size:20px;font-weight:bold}.small{font-size:12.5px;fill:#555}\
.grid{stroke:#e4e4e4;stroke-width:1}.zero{stroke:#9a9a9a;stroke-width:1}\
.frame{fill:none;stroke:#222;stroke-width:1.2}.tick{stroke:#222;stroke-width:1.2}\
.solid{fill:none;stroke:#111;stroke-width:2.4}\
.dashed{fill:none;stroke:#666;stroke-width:1.8;stroke-dasharray:9 6}\
.band{fill:#dbe6f1;stroke:none}\
.up{fill:#1663a8;stroke:none}.down{fill:#fff;stroke:#c04a12;stroke-width:1.5}\
.box{fill:#fff;fill-opacity:.92;stroke:#ccc;stroke-width:1}";

/// A scale from `-end` to `end` with a tick every `step`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    end: f64,
    step: f64,
    decimals: usize,
}

impl Axis {
    /// Symmetric about zero, with room for `extent`; ticks at 1, 2 or 5 times a power of ten.
    pub(super) fn around_zero(extent: f64) -> Self {
        let extent = if extent.is_finite() && extent > 0.0 { extent } else { 1.0 };
        let rough = 2.0 * extent / TICKS;
        let power = 10_f64.powf(rough.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|part| part * power);
        let step = steps.into_iter().find(|step| *step >= rough).unwrap_or(10.0 * power);
        let mut decimals = 0;
        while decimals < 9 && step * 10_f64.powi(i32::try_from(decimals).unwrap_or(0)) < 0.99 {
            decimals += 1;
        }
        Self { end: 1.05 * extent, step, decimals }
    }

    /// Where its ticks are, and what stands beside them.
    fn ticks(self) -> impl Iterator<Item = (f64, String)> {
        let Self { end, step, decimals } = self;
        let count = (end / step).floor();
        let places = std::iter::successors(Some(-count), move |place| {
            (place + 1.0 <= count).then_some(place + 1.0)
        });
        places.map(move |place| {
            let value = place * step;
            (value, format!("{value:.decimals$}").replace('-', "\u{2212}"))
        })
    }

    /// How far along it a value is, 0 to 1.
    fn part(&self, value: f64) -> f64 {
        (value / self.end + 1.0) / 2.0
    }
}

/// A mark's shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// A filled triangle that points up.
    Up,
    /// A hollow one that points down.
    Down,
}

/// A line's pen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pen {
    /// Dark and whole.
    Solid,
    /// Grey, in dashes.
    Dashed,
}

/// A picture in the making.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    svg: String,
    x: Axis,
    y: Axis,
}

impl Chart {
    /// Axes and their names, below a title and a line of small print.
    pub(super) fn new(
        title: &str,
        small: &str,
        (x, x_name): (Axis, &str),
        (y, y_name): (Axis, &str),
    ) -> Self {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\">\n<title>{title}</title>\n\
             <style>{STYLE}</style>\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n",
            title = escaped(title)
        );
        let mut chart = Self { svg, x, y };
        chart.text(LEFT, 34.0, "title", "start", title);
        chart.text(LEFT, 57.0, "small", "start", small);
        chart.axes();
        let middle = f64::midpoint(TOP, BOTTOM);
        chart.text(f64::midpoint(LEFT, RIGHT), HEIGHT - 24.0, "name", "middle", x_name);
        chart.put(&format!(
            "<text transform=\"translate(28 {middle}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            escaped(y_name)
        ));
        chart
    }

    /// A line through points, which must be ordered.
    pub(super) fn line(&mut self, pen: Pen, points: impl Iterator<Item = (f64, f64)>) {
        let class = match pen {
            Pen::Solid => "solid",
            Pen::Dashed => "dashed",
        };
        let points = self.list(points);
        self.put(&format!("<polyline class=\"{class}\" points=\"{points}\"/>"));
    }

    /// The area within points, in order around it.
    pub(super) fn band(&mut self, points: impl Iterator<Item = (f64, f64)>) {
        let points = self.list(points);
        self.put(&format!("<polygon class=\"band\" points=\"{points}\"/>"));
    }

    /// A mark at a point.
    pub(super) fn mark(&mut self, mark: Mark, (x, y): (f64, f64)) {
        let (x, y) = self.place(x, y);
        self.triangle(mark, x, y);
    }

    /// What the lines, marks and the band are called, in the upper left corner.
    pub(super) fn legend(&mut self, up: &str, down: &str, solid: &str, dashed: &str, band: &str) {
        let (x, y) = (LEFT + 16.0, TOP + 16.0);
        self.put(&format!(
            "<rect class=\"box\" x=\"{x}\" y=\"{y}\" width=\"318\" height=\"134\" rx=\"4\"/>"
        ));
        let row = |place: f64| y + 22.0 + 23.0 * place;
        self.triangle(Mark::Up, x + 30.0, row(0.0));
        self.triangle(Mark::Down, x + 30.0, row(1.0));
        for (place, class) in [(2.0, "solid"), (3.0, "dashed")] {
            let (from, to, y) = (x + 12.0, x + 48.0, row(place));
            self.put(&format!("<path class=\"{class}\" d=\"M{from} {y}H{to}\"/>"));
        }
        let (from, top) = (x + 12.0, row(4.0) - 6.0);
        self.put(&format!(
            "<rect class=\"band\" x=\"{from}\" y=\"{top}\" width=\"36\" height=\"12\"/>"
        ));
        for (place, name) in [(0.0, up), (1.0, down), (2.0, solid), (3.0, dashed), (4.0, band)] {
            self.text(x + 60.0, row(place) + 5.0, "name", "start", name);
        }
    }

    /// Lines of text in the lower right corner.
    pub(super) fn notes(&mut self, notes: &[String]) {
        let rows = notes.iter().fold(0.0, |rows, _| rows + 1.0);
        let (width, height) = (318.0, 22.0 * rows + 16.0);
        let (x, y) = (RIGHT - 16.0 - width, BOTTOM - 16.0 - height);
        self.put(&format!(
            "<rect class=\"box\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"4\"/>"
        ));
        let mut row = y + 24.0;
        for note in notes {
            self.text(x + 14.0, row, "name", "start", note);
            row += 22.0;
        }
    }

    /// The finished text.
    pub(super) fn finish(mut self) -> String {
        self.put(&format!(
            "<rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\"/>\n</svg>",
            RIGHT - LEFT,
            BOTTOM - TOP
        ));
        self.svg
    }

    fn axes(&mut self) {
        let class = |value: f64| if value.abs() > 0.0 { "grid" } else { "zero" };
        for (value, name) in self.x.ticks() {
            let (x, _) = self.place(value, 0.0);
            self.put(&format!("<path class=\"{}\" d=\"M{x:.1} {TOP}V{BOTTOM}\"/>", class(value)));
            self.put(&format!("<path class=\"tick\" d=\"M{x:.1} {BOTTOM}v6\"/>"));
            self.text(x, BOTTOM + 23.0, "name", "middle", &name);
        }
        for (value, name) in self.y.ticks() {
            let (_, y) = self.place(0.0, value);
            self.put(&format!("<path class=\"{}\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/>", class(value)));
            self.put(&format!("<path class=\"tick\" d=\"M{LEFT} {y:.1}h-6\"/>"));
            self.text(LEFT - 11.0, y + 5.0, "name", "end", &name);
        }
    }

    fn triangle(&mut self, mark: Mark, x: f64, y: f64) {
        let (class, up) = match mark {
            Mark::Up => ("up", 1.0),
            Mark::Down => ("down", -1.0),
        };
        let (tip, base) = (y - 5.0 * up, y + 3.5 * up);
        let (left, right) = (x - 4.5, x + 4.5);
        self.put(&format!(
            "<path class=\"{class}\" d=\"M{left:.1} {base:.1}H{right:.1}L{x:.1} {tip:.1}Z\"/>"
        ));
    }

    fn text(&mut self, x: f64, y: f64, class: &str, anchor: &str, text: &str) {
        self.put(&format!(
            "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>",
            escaped(text)
        ));
    }

    /// Places in px, as SVG lists them.
    fn list(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        points.fold(String::new(), |mut list, (x, y)| {
            let (x, y) = self.place(x, y);
            write!(list, "{x:.1},{y:.1} ").ok(); // a String takes everything
            list
        })
    }

    /// A point in px, within the frame.
    fn place(&self, x: f64, y: f64) -> (f64, f64) {
        let (x, y) = (self.x.part(x).clamp(0.0, 1.0), self.y.part(y).clamp(0.0, 1.0));
        (LEFT + x * (RIGHT - LEFT), BOTTOM - y * (BOTTOM - TOP))
    }

    fn put(&mut self, element: &str) {
        self.svg.push_str(element);
        self.svg.push('\n');
    }
}

/// Text between tags.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_on_both_sides_of_zero() {
        let names = |extent| -> Vec<String> {
            Axis::around_zero(extent).ticks().map(|(_, name)| name).collect()
        };
        assert_eq!(names(6.3), ["−6", "−4", "−2", "0", "2", "4", "6"]);
        assert_eq!(names(1_750.0), ["−1500", "−1000", "−500", "0", "500", "1000", "1500"]);
        assert_eq!(names(0.12).first().unwrap(), "−0.10");
        assert!(names(f64::NAN).len() > 4);
    }

    #[test]
    fn names_cannot_break_the_picture() {
        let axis = Axis::around_zero(1.0);
        let chart = Chart::new("a<b", "\"c\" & d", (axis, "x"), (axis, "y")).finish();
        assert!(chart.contains("<title>a&lt;b</title>") && chart.contains("\"c\" &amp; d"));
    }
}
