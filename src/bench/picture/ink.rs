//! Elements of SVG as text: escaped names, numbers of a tenth of a pixel.

use std::fmt::Write as _;

/// Width of a character of a text, as a share of its height: a mean over the letters of common fonts.
const CHARACTER: f64 = 0.56;

/// Height of the texts of a picture, in px.
pub(crate) const TEXT: f64 = 12.0;

/// Returns the text escaped for XML, in an element or in quotes. Control characters, which XML does not allow, are replaced.
pub fn escaped(text: &str) -> String {
    let mut written = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '<' => written.push_str("&lt;"),
            '>' => written.push_str("&gt;"),
            '&' => written.push_str("&amp;"),
            '"' => written.push_str("&quot;"),
            '\'' => written.push_str("&#39;"),
            '\t' | '\n' | '\r' => written.push(' '),
            '\u{fffe}' | '\u{ffff}' => written.push('\u{fffd}'),
            other if other.is_control() => written.push('\u{fffd}'),
            other => written.push(other),
        }
    }
    written
}

/// Returns the approximate width of a text, in px: it depends on the font.
pub(crate) fn width_of(text: &str) -> f64 {
    let characters = u32::try_from(text.chars().count()).unwrap_or(u32::MAX);
    f64::from(characters) * TEXT * CHARACTER
}

/// Returns a number with one decimal place, as short as possible: "-.3", "12".
pub(crate) fn tenth(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    match text {
        "-0" => "0".to_owned(),
        _ => match text.strip_prefix("0.").or_else(|| text.strip_prefix("-0.")) {
            Some(digits) if text.starts_with('-') => format!("-.{digits}"),
            Some(digits) => format!(".{digits}"),
            None => text.to_owned(),
        },
    }
}

/// Picture under construction.
#[derive(Debug)]
pub(crate) struct Canvas {
    text: String,
}

impl Canvas {
    /// Creates a picture of this size with a background; `title` is its alternative text.
    pub(crate) fn new(title: &str, width: f64, height: f64) -> Self {
        let (title, width, height) = (escaped(title), tenth(width), tenth(height));
        let mut text = String::new();
        // Writing to a string cannot fail, here and below.
        write!(
            text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"pic\" role=\"img\" aria-label=\"{title}\" \
             width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\
             <rect class=\"bg\" width=\"{width}\" height=\"{height}\"/>"
        )
        .ok();
        Self { text }
    }

    /// Writes a text; `class` defines its colour and its anchor.
    pub(crate) fn text(&mut self, class: &str, [x, y]: [f64; 2], text: &str) {
        let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
        let (x, y) = (tenth(x), tenth(y));
        write!(self.text, "<text{class} x=\"{x}\" y=\"{y}\">{}</text>", escaped(text)).ok();
    }

    /// Writes a rectangle.
    pub(crate) fn rect(&mut self, class: &str, [x, y]: [f64; 2], [width, height]: [f64; 2]) {
        let [x, y, width, height] = [x, y, width, height].map(tenth);
        let place = format!("x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"");
        write!(self.text, "<rect class=\"{class}\" {place}/>").ok();
    }

    /// Writes a path, unless its data is empty.
    pub(crate) fn path(&mut self, class: &str, data: &str) {
        if !data.is_empty() {
            write!(self.text, "<path class=\"{class}\" d=\"{data}\"/>").ok();
        }
    }

    /// Returns the picture.
    pub(crate) fn finish(mut self) -> String {
        self.text.push_str("</svg>");
        self.text
    }
}

/// Data of a path: the first point is absolute, the others are relative, without accumulated rounding errors.
#[derive(Debug, Default)]
pub(crate) struct PathData {
    text: String,
    last: Option<[f64; 2]>,
}

impl PathData {
    /// Starts a new part at this point.
    pub(crate) fn start(&mut self, point: [f64; 2]) {
        let [x, y] = point.map(rounded);
        write!(self.text, "M{}", pair(x, y)).ok();
        self.last = Some([x, y]);
    }

    /// Draws a line to this point, or starts a part there.
    pub(crate) fn line(&mut self, point: [f64; 2]) {
        let Some([from_x, from_y]) = self.last else { return self.start(point) };
        let [x, y] = point.map(rounded);
        write!(self.text, "l{}", pair(x - from_x, y - from_y)).ok();
        self.last = Some([x, y]);
    }

    /// Closes the part; the next line starts another one.
    pub(crate) fn close(&mut self) {
        self.text.push('z');
        self.last = None;
    }

    /// Ends the part; the next line starts another one.
    pub(crate) const fn lift(&mut self) {
        self.last = None;
    }

    /// Returns the value of the attribute `d`.
    pub(crate) fn finish(self) -> String {
        self.text
    }
}

/// Returns two numbers, separated by a space or by the sign of the second.
fn pair(x: f64, y: f64) -> String {
    let (x, y) = (tenth(x), tenth(y));
    let gap = if y.starts_with('-') { "" } else { " " };
    format!("{x}{gap}{y}")
}

fn rounded(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_leave_their_element() {
        assert_eq!(escaped("<script>&\"'"), "&lt;script&gt;&amp;&quot;&#39;");
        assert_eq!(escaped("a\u{0}b\u{1b}\nc\u{ffff}"), "a\u{fffd}b\u{fffd} c\u{fffd}");
    }

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, -0.01, 0.26, -0.34, 12.0, -1.5].map(tenth);
        assert_eq!(texts, ["0", "0", ".3", "-.3", "12", "-1.5"]);
    }

    #[test]
    fn relative_lines_do_not_drift() {
        let mut path = PathData::default();
        for step in 0..=1_000_u32 {
            path.line([f64::from(step) * 0.033, 1.0]);
        }
        let text = path.finish();
        let steps = text.split(['M', 'l']).skip(1).map(|pair| pair.split(' ').next().unwrap());
        let end: f64 = steps.map(|step| step.parse::<f64>().unwrap()).sum();
        assert!((end - 33.0).abs() < 0.051, "{end}");
    }
}
