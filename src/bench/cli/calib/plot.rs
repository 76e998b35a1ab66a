//! Plot of a joint's torque curve as in the paper's Fig. 6: measurements in both driving directions, straight line and
//! polynomial; below, the residuals of the measurements.

use crate::chart::{Axis, Chart, Ink, Panel, minus};
use crate::fit::{Calibrated, Direction, Sample};
use telemetry::digits::significant;

/// Points of a curve.
const POINTS: u16 = 160;
/// Upper and lower edges of the two panels, and the total height, in px.
const CURVE: [f64; 2] = [74.0, 500.0];
const REST: [f64; 2] = [566.0, 706.0];
const HEIGHT: f64 = 768.0;

/// Content of a plot.
#[derive(Clone, Copy, Debug)]
pub struct TorquePlot<'a> {
    /// Name of the joint.
    pub joint: &'a str,
    /// Source of the samples.
    pub provenance: &'a str,
    /// Unit: `N·m`, or `N` for a prismatic joint.
    pub unit: &'a str,
    /// Measured samples.
    pub samples: &'a [Sample],
    /// Fit of the samples.
    pub calibrated: &'a Calibrated,
    /// Straight line for comparison: name, and slope in ‰ per N·m.
    pub line: (&'a str, f64),
}

impl TorquePlot<'_> {
    /// Returns the plot as SVG. Targets of an inverted motor are drawn negated.
    pub fn svg(&self) -> String {
        let torque = format!("joint torque in {}", self.unit);
        let mut chart =
            Chart::new(&format!("Torque curve of {}", self.joint), self.provenance, HEIGHT);
        self.curve(&mut chart, &torque);
        self.rest(&mut chart, &torque);
        chart.finish()
    }

    /// Draws the upper panel: target over torque.
    fn curve(&self, chart: &mut Chart, torque: &str) {
        let Self { calibrated, line: (line, slope), .. } = *self;
        let target = if calibrated.is_reversed {
            "negated target (6071h) in ‰ of rated torque"
        } else {
            "target torque (6071h) in ‰ of rated torque"
        };
        let reach = self.reach();
        let extent = self.most(|_, per_mille| per_mille);
        let [top, bottom] = CURVE;
        let x = Axis::new(torque, reach, 15.0);
        let panel = Panel { x, y: Axis::new(target, extent, 13.0), top, bottom };
        chart.axes(&panel);
        let far = reach.min(extent / slope);
        chart.draw(&panel, Ink::Dashed, [-far, far].into_iter().map(|t| (t, slope * t)));
        self.marks(chart, &panel, |_, per_mille| per_mille);
        let end = calibrated.curve.max_torque();
        let curve = along(-end, end).map(|t| (t, calibrated.curve.at(t)));
        chart.draw(&panel, Ink::Solid, curve);
        let mut entries = vec![
            (Ink::Up, "measured, torque rising"),
            (Ink::Down, "measured, torque falling"),
            (Ink::Solid, "polynomial c₁t + c₃t³ + c₅t⁵"),
            (Ink::Dashed, line),
            (Ink::Band, "between the driving directions"),
        ];
        if !calibrated.outliers.is_empty() {
            entries.push((Ink::Ring, "left out of the fit"));
        }
        chart.legend(&panel, &entries);
        chart.notes(&panel, &notes(calibrated, self.unit));
        chart.frame(&panel);
    }

    /// Draws the lower panel: residuals of the polynomial.
    fn rest(&self, chart: &mut Chart, torque: &str) {
        let calibrated = self.calibrated;
        let rest = |t: f64, per_mille: f64| per_mille - calibrated.both.at(t);
        let [top, bottom] = REST;
        let x = Axis::new(torque, self.reach(), 15.0);
        let panel =
            Panel { x, y: Axis::new("less polynomial, ‰", self.most(rest), 7.0), top, bottom };
        chart.axes(&panel);
        let end = calibrated.curve.max_torque();
        let up = along(-end, end).map(|t| (t, rest(t, calibrated.branch_up.at(t))));
        let down = along(end, -end).map(|t| (t, rest(t, calibrated.branch_down.at(t))));
        chart.draw(&panel, Ink::Band, up.chain(down));
        chart.draw(&panel, Ink::Solid, [(-end, 0.0), (end, 0.0)].into_iter());
        self.marks(chart, &panel, rest);
        chart.frame(&panel);
    }

    /// Draws a mark per sample, and a ring about each that was left out, at its torque and the value that `of` computes.
    fn marks(&self, chart: &mut Chart, panel: &Panel<'_>, of: impl Fn(f64, f64) -> f64) {
        for (ink, direction) in [(Ink::Up, Direction::Up), (Ink::Down, Direction::Down)] {
            let samples = self.samples.iter().filter(|sample| sample.direction == direction);
            let place = |sample: &Sample| (sample.torque, of(sample.torque, self.target(sample)));
            chart.draw(panel, ink, samples.map(place));
        }
        let outliers = self.calibrated.outliers.iter();
        let outliers = outliers.filter_map(|outlier| self.samples.get(outlier.place));
        let place = |sample: &Sample| (sample.torque, of(sample.torque, self.target(sample)));
        chart.draw(panel, Ink::Ring, outliers.map(place));
    }

    /// Returns the target of a sample with the sign of its torque.
    fn target(&self, sample: &Sample) -> f64 {
        if self.calibrated.is_reversed { -sample.per_mille } else { sample.per_mille }
    }

    /// Returns the largest torque.
    fn reach(&self) -> f64 {
        self.most(|torque, _| torque)
    }

    /// Returns the largest magnitude that `of` computes.
    fn most(&self, of: impl Fn(f64, f64) -> f64) -> f64 {
        let values = self.samples.iter().map(|sample| of(sample.torque, self.target(sample)).abs());
        values.fold(0.0, f64::max)
    }
}

/// Returns the results of the fit as lines of text.
fn notes(calibrated: &Calibrated, unit: &str) -> [String; 6] {
    let [c1, c3, c5] = calibrated.curve.coefficients().map(|c| significant(c, 5));
    let residuals = calibrated.both.residuals;
    let friction = calibrated.friction;
    let (least, _) = calibrated.curve.least_slope();
    [
        minus(&format!("c₁ {c1}, c₃ {c3}, c₅ {c5}")),
        format!("range ±{:.3} {unit}", calibrated.curve.max_torque()),
        format!("rises by {least:.1} ‰ per {unit} at least"),
        format!("residual {:.1} ‰ RMS, {:.1} ‰ at most", residuals.rms, residuals.largest),
        format!("each sample left out: {:.1} ‰ RMS", residuals.left_out_rms),
        format!(
            "friction {:.3} {unit}, hysteresis {:.3} {unit}",
            friction.torque,
            friction.hysteresis()
        ),
    ]
}

/// Samples torques from one to another.
fn along(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..=POINTS).map(move |place| from + (to - from) * f64::from(place) / f64::from(POINTS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_marked_in_both_panels() {
        let sample = |direction| {
            (-12..=12).map(move |step| Sample {
                torque: f64::from(step) / 4.0,
                per_mille: -f64::from(step) * 50.0,
                direction,
            })
        };
        let mut samples: Vec<Sample> =
            sample(Direction::Up).chain(sample(Direction::Down)).collect();
        samples[5].torque += 2.0;
        let plot = TorquePlot {
            joint: "elbow",
            provenance: "a.csv: 50 samples",
            unit: "N·m",
            samples: &samples,
            calibrated: &Calibrated::fit(&samples).unwrap(),
            line: ("rated torque times gear ratio", 180.0),
        };
        let svg = plot.svg();
        assert_eq!(svg.matches("class=\"up\"").count(), 2 * 25 + 1);
        assert_eq!(svg.matches("class=\"down\"").count(), 2 * 25 + 1);
        // One in each panel, and one in the legend.
        assert_eq!(svg.matches("class=\"ring\"").count(), 3);
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
        assert!(!svg.contains("NaN") && svg.contains("negated target"));
    }
}
