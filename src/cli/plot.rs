//! A torque curve as a picture in the manner of the paper's Fig. 6: what was measured, the straight line
//! of the manufacturer, and the polynomial.

use std::fmt::Write;

use crate::controller::fit::JointFit;
use crate::controller::fit::Sample;

/// Size of the picture and where the axes are in it, in pixels.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 520.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 24.0;
const TOP: f64 = 52.0;
const BOTTOM: f64 = 64.0;

/// Points of a drawn curve.
const POINTS: u32 = 160;

/// One joint's picture.
pub(super) struct Picture<'f> {
    /// Its name.
    pub(super) joint: &'f str,
    /// What was measured.
    pub(super) samples: &'f [Sample],
    /// What was made of it.
    pub(super) fit: &'f JointFit,
    /// ‰ per N·m according to the manufacturer, if known.
    pub(super) line: Option<f64>,
    /// N·m or N.
    pub(super) unit: &'static str,
}

/// From torques and per mille to pixels.
struct Scale {
    torque: f64,
    per_mille: f64,
}

impl Scale {
    fn x(&self, torque: f64) -> f64 {
        LEFT + (torque / self.torque + 1.0) / 2.0 * (WIDTH - LEFT - RIGHT)
    }

    fn y(&self, per_mille: f64) -> f64 {
        HEIGHT - BOTTOM - (per_mille / self.per_mille + 1.0) / 2.0 * (HEIGHT - TOP - BOTTOM)
    }
}

/// The picture as SVG.
pub(super) fn svg(picture: &Picture<'_>) -> String {
    let Picture { joint, samples, fit, line, unit } = *picture;
    let reach =
        |of: fn(&Sample) -> f64| samples.iter().map(|sample| of(sample).abs()).fold(0.0, f64::max);
    let range = fit.curve.max_torque();
    let end = line.map_or(0.0, |slope| (slope * range).abs());
    let scale = Scale {
        torque: round_up(reach(|sample| sample.torque)),
        per_mille: round_up(reach(|sample| sample.per_mille).max(end)),
    };
    let mut svg = String::new();
    svg.push_str(&format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" \
         height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"16\">{}: torque to command</text>\n",
        escaped(joint)
    ));
    axes(&mut svg, &scale, unit);
    if let Some(slope) = line {
        let [from, to] = [-range, range].map(|t| (scale.x(t), scale.y(slope * t)));
        svg.push_str(&format!(
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"#888\" \
             stroke-width=\"1.5\" stroke-dasharray=\"7 5\"/>\n",
            from.0, from.1, to.0, to.1
        ));
    }
    let curve = (0..=POINTS).map(|point| {
        let torque = range * (f64::from(point) / f64::from(POINTS) * 2.0 - 1.0);
        (scale.x(torque), scale.y(fit.sign * fit.curve.at(torque)))
    });
    path(&mut svg, curve, "#c0392b");
    for sample in samples {
        mark(&mut svg, scale.x(sample.torque), scale.y(sample.per_mille), sample.rising);
    }
    legend(&mut svg, line.is_some());
    svg.push_str("</svg>\n");
    svg
}

/// Frame, ticks and what they count.
fn axes(svg: &mut String, scale: &Scale, unit: &str) {
    let (low, high) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
    for step in -4..=4 {
        let part = f64::from(step) / 4.0;
        let (torque, per_mille) = (part * scale.torque, part * scale.per_mille);
        let (x, y) = (scale.x(torque), scale.y(per_mille));
        let grid = if step == 0 { "#999" } else { "#e4e4e4" };
        svg.push_str(&format!(
            "<path d=\"M{x:.1} {TOP} V{low} M{LEFT} {y:.1} H{high}\" stroke=\"{grid}\"/>\n\
             <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
            low + 18.0,
            plain(torque),
            LEFT - 8.0,
            y + 4.5,
            plain(per_mille)
        ));
    }
    svg.push_str(&format!(
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">torque of the joint, {unit}</text>\n\
         <text transform=\"translate(20 {:.1}) rotate(-90)\" text-anchor=\"middle\">command, ‰ of rated \
         torque</text>\n",
        f64::midpoint(LEFT, high),
        low + 44.0,
        f64::midpoint(TOP, low)
    ));
}

/// A circle while the command rises, a cross while it falls.
fn mark(svg: &mut String, x: f64, y: f64, rising: bool) {
    let mark = if rising {
        format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.2\" fill=\"none\" stroke=\"#1f4e79\"/>\n"
        )
    } else {
        let [l, r, t, b] = [x - 3.0, x + 3.0, y - 3.0, y + 3.0];
        format!(
            "<path d=\"M{l:.1} {t:.1} L{r:.1} {b:.1} M{l:.1} {b:.1} L{r:.1} {t:.1}\" stroke=\"#1f4e79\"/>\n"
        )
    };
    svg.push_str(&mark);
}

fn path(svg: &mut String, points: impl Iterator<Item = (f64, f64)>, colour: &str) {
    svg.push_str("<path fill=\"none\" stroke-width=\"2\" stroke=\"");
    svg.push_str(colour);
    svg.push_str("\" d=\"");
    for (place, (x, y)) in points.enumerate() {
        // Writing to a string cannot fail.
        write!(svg, "{}{x:.1} {y:.1} ", if place == 0 { 'M' } else { 'L' }).ok();
    }
    svg.push_str("\"/>\n");
}

fn legend(svg: &mut String, has_line: bool) {
    let x = WIDTH - RIGHT - 440.0;
    let text = |svg: &mut String, x: f64, what: &str| {
        svg.push_str(&format!("<text x=\"{x:.1}\" y=\"42\" font-size=\"12\">{what}</text>\n"));
    };
    mark(svg, x, 38.0, true);
    text(svg, x + 9.0, "rising");
    mark(svg, x + 65.0, 38.0, false);
    text(svg, x + 74.0, "falling");
    path(svg, [(x + 130.0, 38.0), (x + 160.0, 38.0)].into_iter(), "#c0392b");
    text(svg, x + 166.0, "polynomial");
    if has_line {
        svg.push_str(&format!(
            "<path d=\"M{:.1} 38 h30\" stroke=\"#888\" stroke-width=\"1.5\" stroke-dasharray=\"7 5\"/>\n",
            x + 250.0
        ));
        text(svg, x + 286.0, "rated torque and gear alone");
    }
}

/// The next number whose quarters are short.
fn round_up(value: f64) -> f64 {
    let power = 10_f64.powf(value.max(1e-9).log10().floor());
    let steps = [1.0, 1.2, 1.6, 2.0, 2.4, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let fits = steps.into_iter().map(|step| step * power).find(|step| *step >= value);
    fits.unwrap_or(value)
}

/// A number without zeros that say nothing.
fn plain(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
