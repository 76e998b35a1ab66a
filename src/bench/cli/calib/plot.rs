//! Plot of a joint's torque curve as in the paper's Fig. 6: measurements in both driving directions, straight line and
//! polynomial; below, the residuals of the measurements.

use calibration::fit::{CurveFit, Direction, Sample};
use picture::{self, Ink, Panel, Series};
use run::exit::{Failure, Kind, OrFail};
use telemetry::digits::significant;

/// Number of points of a drawn curve.
const POINTS: u16 = 160;

/// Content of a plot.
#[derive(Clone, Copy, Debug)]
pub(super) struct TorquePlot<'a> {
    /// Name of the joint.
    pub(super) joint: &'a str,
    /// Source of the samples.
    pub(super) provenance: &'a str,
    /// Unit: `N·m`, or `N` for a prismatic joint.
    pub(super) unit: &'a str,
    /// Measured samples.
    pub(super) samples: &'a [Sample],
    /// Fit of the samples.
    pub(super) calibrated: &'a CurveFit,
    /// Straight line for comparison: name, and slope in ‰ per N·m.
    pub(super) line: (&'a str, f64),
}

impl TorquePlot<'_> {
    /// Returns the plot as SVG. Targets of an inverted motor are drawn negated.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be drawn.
    pub(super) fn svg(&self) -> Result<String, Failure> {
        picture::svg(&[self.curve(), self.rest()], 1).or_fail(Kind::File)
    }

    /// Returns the panel of target over torque.
    fn curve(&self) -> Panel {
        let Self { calibrated, line: (line, slope), .. } = *self;
        let target = if calibrated.is_reversed {
            "negated target (6071h) in ‰ of rated torque"
        } else {
            "target torque (6071h) in ‰ of rated torque"
        };
        let most = |of: fn(&[f64; 2]) -> f64| {
            let all = self.points(|_| true, |_, per_mille| per_mille);
            all.map(|point| of(&point).abs()).fold(0.0, f64::max)
        };
        let far = most(|[torque, _]| *torque).min(most(|[_, target]| *target) / slope);
        let end = calibrated.curve.max_torque();
        let polynomial = along(-end, end).map(|t| [t, calibrated.curve.at(t)]);
        let mut series = vec![
            Series::new("polynomial c₁t + c₃t³ + c₅t⁵", Ink::Line, polynomial),
            Series::new(line, Ink::Dashed, [-far, far].map(|t| [t, slope * t])),
        ];
        series.extend(self.marks(|_, per_mille| per_mille));
        let title = format!("Torque curve of {}", self.joint);
        let mut panel = Panel::new(title, [&self.torque(), target], series);
        panel.notes = vec![self.provenance.to_owned(), curve_note(calibrated, self.unit)];
        panel
    }

    /// Returns the panel of the polynomial's residuals.
    fn rest(&self) -> Panel {
        let calibrated = self.calibrated;
        let rest = |t: f64, per_mille: f64| per_mille - calibrated.both.at(t);
        let end = calibrated.curve.max_torque();
        let up = along(-end, end).map(|t| [t, rest(t, calibrated.branch_up.at(t))]);
        let down = along(end, -end).map(|t| [t, rest(t, calibrated.branch_down.at(t))]);
        let mut series = vec![
            Series::new("polynomial", Ink::Line, [[-end, 0.0], [end, 0.0]]),
            Series::new("between the driving directions", Ink::Band, up.chain(down)),
        ];
        series.extend(self.marks(rest));
        let mut panel = Panel::new("Residuals", [&self.torque(), "less polynomial, ‰"], series);
        panel.notes = rest_notes(calibrated, self.unit).into();
        panel
    }

    /// Returns the label of the torque axis.
    fn torque(&self) -> String {
        format!("joint torque in {}", self.unit)
    }

    /// Returns a mark per sample, and a ring around each outlier, at its torque and the value computed by `of`.
    fn marks(&self, of: impl Fn(f64, f64) -> f64 + Copy) -> Vec<Series> {
        let marks = |name, direction| {
            let is_it = move |sample: &&Sample| sample.direction == direction;
            Series::new(name, Ink::Marks, self.points(is_it, of))
        };
        let left_out = self.calibrated.outliers.iter();
        let left_out = left_out.filter_map(|outlier| self.samples.get(outlier.place));
        let rings = left_out.map(|sample| self.point(sample, of)).collect::<Vec<_>>();
        let mut series = vec![
            marks("measured, torque rising", Direction::Up),
            marks("measured, torque falling", Direction::Down),
        ];
        if !rings.is_empty() {
            series.push(Series::new("left out of the fit", Ink::Rings, rings));
        }
        series
    }

    /// Returns the points of the samples selected by `is_meant`.
    fn points(
        &self,
        is_meant: impl Fn(&&Sample) -> bool,
        of: impl Fn(f64, f64) -> f64 + Copy,
    ) -> impl Iterator<Item = [f64; 2]> {
        self.samples.iter().filter(is_meant).map(move |sample| self.point(sample, of))
    }

    /// Returns torque and value of a sample; its target has the sign of the torque.
    fn point(&self, sample: &Sample, of: impl Fn(f64, f64) -> f64) -> [f64; 2] {
        let target = if self.calibrated.is_reversed { -sample.per_mille } else { sample.per_mille };
        [sample.torque, of(sample.torque, target)]
    }
}

/// Returns the coefficients of the curve, and its range.
fn curve_note(calibrated: &CurveFit, unit: &str) -> String {
    let [c1, c3, c5] = calibrated.curve.coefficients().map(|c| significant(c, 5));
    let (least, _) = calibrated.curve.least_slope();
    let range = calibrated.curve.max_torque();
    format!(
        "c₁ {c1}, c₃ {c3}, c₅ {c5}; range ±{range:.3} {unit}; rises by {least:.1} ‰ per {unit} at least"
    )
}

/// Returns the notes on residuals and on the friction between the directions.
fn rest_notes(calibrated: &CurveFit, unit: &str) -> [String; 2] {
    let residuals = calibrated.both.residuals;
    let friction = calibrated.friction;
    [
        format!(
            "residual {:.1} ‰ RMS, {:.1} ‰ at most; each sample left out: {:.1} ‰ RMS",
            residuals.rms, residuals.largest, residuals.left_out_rms
        ),
        format!(
            "friction {:.3} {unit}, hysteresis {:.3} {unit}",
            friction.torque,
            friction.hysteresis()
        ),
    ]
}

/// Returns equally spaced torques from one to another.
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
            calibrated: &CurveFit::fit(&samples).unwrap(),
            line: ("rated torque times gear ratio", 180.0),
        };
        for panel in [plot.curve(), plot.rest()] {
            let marked = |ink| {
                let inked = panel.series.iter().filter(|series| series.ink == ink);
                inked.map(|series| series.points.len()).collect::<Vec<_>>()
            };
            assert_eq!((marked(Ink::Marks), marked(Ink::Rings)), (vec![25, 25], vec![1]));
        }
        let svg = plot.svg().unwrap();
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
        assert!(!svg.contains("NaN") && svg.contains("negated target"));
    }
}
