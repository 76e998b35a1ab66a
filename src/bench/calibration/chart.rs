//! Charts as standalone SVG text: panels with two axes, and lines, bands and marks on them.
//!
//! Dark on white, for screen and paper. [`torque_plot`](crate::torque_plot) selects the content.

use std::fmt::Write;

/// Width of a picture, in px.
const WIDTH: f64 = 860.0;
/// Horizontal limits of panels, in px.
const LEFT: f64 = 92.0;
const RIGHT: f64 = 834.0;
/// Width of a text box in a panel, in px.
const BOX: f64 = 312.0;
const ROW: f64 = 22.0;

const STYLE: &str = "text{font-family:Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;\
font-size:14px;fill:#222}.title{font-size:20px;font-weight:bold}.small{font-size:12.5px;fill:#555}\
.grid{stroke:#e4e4e4;stroke-width:1}.zero{stroke:#9a9a9a;stroke-width:1}\
.frame{fill:none;stroke:#222;stroke-width:1.2}.tick{stroke:#222;stroke-width:1.2}\
.solid{fill:none;stroke:#111;stroke-width:2.2}\
.dashed{fill:none;stroke:#666;stroke-width:1.8;stroke-dasharray:9 6}\
.band{fill:#d5e2ee;stroke:none}\
.up{fill:#1663a8;stroke:none}.down{fill:#fff;stroke:#c04a12;stroke-width:1.4}\
.ring{fill:none;stroke:#b00020;stroke-width:1.6}\
.box{fill:#fff;fill-opacity:.92;stroke:#ccc;stroke-width:1}";

/// A scale symmetric about zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis<'a> {
    /// Label.
    name: &'a str,
    /// The scale extends from `-end` to `end`.
    end: f64,
    /// Distance between ticks.
    step: f64,
    /// Decimals of the tick labels.
    decimals: usize,
}

impl<'a> Axis<'a> {
    /// Creates a scale for `extent` with at most `most` ticks, at 1, 2 or 5 times a power of ten.
    pub(super) fn new(name: &'a str, extent: f64, most: f64) -> Self {
        let extent = if extent.is_normal() { extent.abs() } else { 1.0 };
        let rough = 2.1 * extent / most;
        let power = 10_f64.powf(rough.log10().floor());
        let steps = [1.0, 2.0, 5.0].map(|part| part * power);
        let step = steps.into_iter().find(|step| *step >= rough).unwrap_or(10.0 * power);
        let decimals = (0..9_u8).find(|n| step * 10_f64.powi((*n).into()) > 0.99);
        Self { name, end: 1.05 * extent, step, decimals: decimals.unwrap_or(9).into() }
    }

    /// Returns the ticks with their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        let (step, decimals) = (self.step, self.decimals);
        let count = (self.end / step).floor();
        let next = |place: &f64| (place + 1.0 <= count).then_some(place + 1.0);
        let places = std::iter::successors(Some(-count), next);
        let tick = |value: f64| (value, minus(&format!("{value:.decimals$}")));
        places.map(|place| tick(place * step)).collect()
    }

    /// Returns the position of a value on the scale, 0 to 1.
    fn part(&self, value: f64) -> f64 {
        f64::midpoint(value / self.end, 1.0).clamp(0.0, 1.0)
    }
}

/// Two axes and the frame around them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Panel<'a> {
    /// Horizontal axis.
    pub(super) x: Axis<'a>,
    /// Vertical axis.
    pub(super) y: Axis<'a>,
    /// Upper edge in the picture, in px.
    pub(super) top: f64,
    /// Lower edge in the picture, in px.
    pub(super) bottom: f64,
}

impl Panel<'_> {
    /// Converts a point to px of the picture.
    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let (x, y) = (self.x.part(x), self.y.part(y));
        (LEFT + x * (RIGHT - LEFT), self.bottom - y * (self.bottom - self.top))
    }

    /// Formats points in px as an SVG list.
    fn list(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        points.fold(String::new(), |mut list, point| {
            let (x, y) = self.place(point);
            write!(list, "{x:.1},{y:.1} ").ok(); // infallible for a String
            list
        })
    }
}

/// Style of a mark, line or area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ink {
    /// A filled triangle that points up.
    Up,
    /// A hollow one that points down.
    Down,
    /// A dark line.
    Solid,
    /// A grey line in dashes.
    Dashed,
    /// A pale area.
    Band,
    /// A ring about a mark.
    Ring,
}

impl Ink {
    const fn class(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Down => "down",
            Self::Solid => "solid",
            Self::Dashed => "dashed",
            Self::Band => "band",
            Self::Ring => "ring",
        }
    }
}

/// A picture being drawn.
#[derive(Clone, Debug)]
pub(super) struct Chart(String);

impl Chart {
    /// Starts a picture with a title, a line of small print, and room for panels down to `height` in px.
    pub(super) fn new(title: &str, small: &str, height: f64) -> Self {
        let name = escaped(title);
        let mut chart = Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
             width=\"{WIDTH}\" height=\"{height}\" role=\"img\">\n<title>{name}</title>\n\
             <style>{STYLE}</style>\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n"
        ));
        chart.text("title", "start", (LEFT, 34.0), title);
        chart.text("small", "start", (LEFT, 57.0), small);
        chart
    }

    /// Draws the axes of a panel; call it before the content.
    pub(super) fn axes(&mut self, panel: &Panel<'_>) {
        let (top, bottom) = (panel.top, panel.bottom);
        let class = |value: f64| if value.abs() > 0.0 { "grid" } else { "zero" };
        for (value, number) in panel.x.ticks() {
            let (x, _) = panel.place((value, 0.0));
            self.put(&format!("<path class=\"{}\" d=\"M{x:.1} {top}V{bottom}\"/>", class(value)));
            self.put(&format!("<path class=\"tick\" d=\"M{x:.1} {bottom}v6\"/>"));
            self.text("number", "middle", (x, bottom + 22.0), &number);
        }
        for (value, number) in panel.y.ticks() {
            let (_, y) = panel.place((0.0, value));
            self.put(&format!("<path class=\"{}\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/>", class(value)));
            self.put(&format!("<path class=\"tick\" d=\"M{LEFT} {y:.1}h-6\"/>"));
            self.text("number", "end", (LEFT - 11.0, y + 5.0), &number);
        }
        self.text("name", "middle", (f64::midpoint(LEFT, RIGHT), bottom + 46.0), panel.x.name);
        let (middle, name) = (f64::midpoint(top, bottom), escaped(panel.y.name));
        self.put(&format!(
            "<text transform=\"translate(26 {middle}) rotate(-90)\" text-anchor=\"middle\">{name}</text>"
        ));
    }

    /// Draws the frame of a panel; call it after the content.
    pub(super) fn frame(&mut self, Panel { top, bottom, .. }: &Panel<'_>) {
        let (width, height) = (RIGHT - LEFT, bottom - top);
        self.put(&format!(
            "<rect class=\"frame\" x=\"{LEFT}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"/>"
        ));
    }

    /// Draws points in order: a line through them, the area within them, or a mark at each.
    pub(super) fn draw(
        &mut self,
        panel: &Panel<'_>,
        ink: Ink,
        points: impl Iterator<Item = (f64, f64)>,
    ) {
        let shape = match ink {
            Ink::Up | Ink::Down | Ink::Ring => {
                return points.for_each(|at| self.mark(ink, panel.place(at)));
            }
            Ink::Solid | Ink::Dashed => "polyline",
            Ink::Band => "polygon",
        };
        let (class, points) = (ink.class(), panel.list(points));
        self.put(&format!("<{shape} class=\"{class}\" points=\"{points}\"/>"));
    }

    /// Draws a legend in the upper left corner of a panel.
    pub(super) fn legend(&mut self, panel: &Panel<'_>, entries: &[(Ink, &str)]) {
        let (left, top) = (LEFT + 16.0, panel.top + 16.0);
        let mut y = self.text_box(left, top, entries.len());
        for (ink, name) in entries {
            let (class, from, to) = (ink.class(), left + 12.0, left + 48.0);
            match ink {
                Ink::Up | Ink::Down | Ink::Ring => self.mark(*ink, (left + 30.0, y)),
                Ink::Solid | Ink::Dashed => {
                    self.put(&format!("<path class=\"{class}\" d=\"M{from} {y}H{to}\"/>"));
                }
                Ink::Band => {
                    let (above, below) = (y - 6.0, y + 6.0);
                    self.put(&format!(
                        "<path class=\"{class}\" d=\"M{from} {above}H{to}V{below}H{from}Z\"/>"
                    ));
                }
            }
            self.text("entry", "start", (left + 60.0, y + 5.0), name);
            y += ROW;
        }
    }

    /// Draws lines of text in the lower right corner of a panel.
    pub(super) fn notes(&mut self, panel: &Panel<'_>, notes: &[String]) {
        let height = notes.iter().fold(16.0, |height, _| height + ROW);
        let left = RIGHT - 16.0 - BOX;
        let mut y = self.text_box(left, panel.bottom - 16.0 - height, notes.len());
        for note in notes {
            self.text("note", "start", (left + 14.0, y + 5.0), note);
            y += ROW;
        }
    }

    /// Returns the finished SVG text.
    pub(super) fn finish(self) -> String {
        self.0 + "</svg>\n"
    }

    /// Draws a box for some rows of text; returns the vertical centre of the first.
    fn text_box(&mut self, left: f64, top: f64, rows: usize) -> f64 {
        let height = (0..rows).fold(16.0, |height, _| height + ROW);
        self.put(&format!(
            "<rect class=\"box\" x=\"{left}\" y=\"{top}\" width=\"{BOX}\" height=\"{height}\" rx=\"4\"/>"
        ));
        top + 8.0 + ROW / 2.0
    }

    /// Draws a triangle at a point in px, filled and upward or hollow and downward; or a ring.
    fn mark(&mut self, ink: Ink, (x, y): (f64, f64)) {
        if ink == Ink::Ring {
            let class = ink.class();
            return self
                .put(&format!("<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"9\"/>"));
        }
        let up = if ink == Ink::Up { 1.0 } else { -1.0 };
        let (tip, base) = (y - 5.0 * up, y + 3.5 * up);
        let (class, left, right) = (ink.class(), x - 4.5, x + 4.5);
        self.put(&format!(
            "<path class=\"{class}\" d=\"M{left:.1} {base:.1}H{right:.1}L{x:.1} {tip:.1}Z\"/>"
        ));
    }

    fn text(&mut self, class: &str, anchor: &str, (x, y): (f64, f64), text: &str) {
        let text = escaped(text);
        self.put(&format!(
            "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{text}</text>"
        ));
    }

    fn put(&mut self, element: &str) {
        self.0.push_str(element);
        self.0.push('\n');
    }
}

/// Formats a number with a minus as wide as a plus.
pub(super) fn minus(number: &str) -> String {
    number.replace('-', "\u{2212}")
}

/// Escapes text between tags.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_on_both_sides_of_zero() {
        let numbers = |extent, most| -> Vec<String> {
            Axis::new("x", extent, most).ticks().into_iter().map(|(_, number)| number).collect()
        };
        assert_eq!(numbers(6.3, 9.0), ["−6", "−4", "−2", "0", "2", "4", "6"]);
        assert_eq!(numbers(0.12, 6.0), ["−0.10", "−0.05", "0.00", "0.05", "0.10"]);
        assert_eq!(numbers(1_750.0, 5.0), ["−1000", "0", "1000"]);
        for extent in [0.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
            assert!(numbers(extent, 9.0).len() > 2, "{extent}");
        }
    }

    #[test]
    fn names_are_escaped() {
        let chart = Chart::new("a<b", "\"c\" & d", 100.0).finish();
        assert!(chart.contains("<title>a&lt;b</title>") && chart.contains("\"c\" &amp; d"));
    }

    #[test]
    fn values_beyond_an_axis_are_drawn_at_its_end() {
        let axis = || Axis::new("x", 1.0, 9.0);
        let panel = Panel { x: axis(), y: axis(), top: 10.0, bottom: 110.0 };
        assert_eq!(panel.place((0.0, 0.0)), (f64::midpoint(LEFT, RIGHT), 60.0));
        assert_eq!(panel.place((9.0, -9.0)), (RIGHT, 110.0));
    }
}
