//! A joint's torque curve in the manner of the paper's Fig. 6: measurements of both driving
//! directions, the straight line, the polynomial.

use crate::controller::fit::Calibrated;
use crate::controller::fit::Direction;
use crate::controller::fit::Sample;
use crate::telemetry::chart::Axis;
use crate::telemetry::chart::Chart;
use crate::telemetry::chart::Mark;
use crate::telemetry::chart::Pen;
use crate::telemetry::digits::significant;

/// Points of a curve.
const POINTS: u16 = 160;

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct TorquePlot<'a> {
    /// The joint's name.
    pub joint: &'a str,
    /// Where the samples come from.
    pub provenance: &'a str,
    /// `N·m`, or `N` of a sliding joint.
    pub unit: &'a str,
    /// As they were measured.
    pub samples: &'a [Sample],
    /// What they gave.
    pub calibrated: &'a Calibrated,
    /// The straight line to compare with: what it is, and its slope in ‰ per N·m.
    pub line: (&'a str, f64),
}

impl TorquePlot<'_> {
    /// The picture, as SVG.
    pub fn svg(&self) -> String {
        let Self { joint, provenance, unit, samples, calibrated, line } = *self;
        // Drawn rising in any case.
        let (sign, target) = if calibrated.is_reversed {
            (-1.0, "negated target torque (6071h) in ‰ of rated torque")
        } else {
            (1.0, "target torque (6071h) in ‰ of rated torque")
        };
        let most = |of: fn(&Sample) -> f64| samples.iter().map(of).fold(0.0, f64::max);
        let reach = most(|sample| sample.torque.abs());
        let extent = most(|sample| sample.per_mille.abs());
        let mut chart = Chart::new(
            &format!("Torque curve of {joint}"),
            provenance,
            (Axis::around_zero(reach), &format!("joint torque in {unit}")),
            (Axis::around_zero(extent), target),
        );
        let end = calibrated.curve.max_torque();
        let up = along(-end, end).map(|t| (t, calibrated.branch_up.at(t)));
        let down = along(end, -end).map(|t| (t, calibrated.branch_down.at(t)));
        chart.band(up.chain(down));
        let (name, slope) = line;
        let far = reach.min(extent / slope);
        chart.line(Pen::Dashed, [-far, far].into_iter().map(|t| (t, slope * t)));
        for sample in samples {
            let mark = match sample.direction {
                Direction::Up => Mark::Up,
                Direction::Down => Mark::Down,
            };
            chart.mark(mark, (sample.torque, sign * sample.per_mille));
        }
        chart.line(Pen::Solid, along(-end, end).map(|t| (t, calibrated.curve.at(t))));
        chart.legend(
            "measured, torque rising",
            "measured, torque falling",
            "polynomial, c₁t + c₃t³ + c₅t⁵",
            name,
            "between the driving directions",
        );
        chart.notes(&notes(calibrated, unit));
        chart.finish()
    }
}

/// What the fit came to.
fn notes(calibrated: &Calibrated, unit: &str) -> [String; 5] {
    let [c1, c3, c5] = calibrated.curve.coefficients().map(|c| significant(c, 5));
    let residuals = calibrated.both.residuals;
    let hysteresis = calibrated.hysteresis;
    let (least, _) = calibrated.curve.least_slope();
    [
        format!("c₁ {c1}   c₃ {c3}   c₅ {c5}").replace('-', "\u{2212}"),
        format!(
            "rises by {least:.1} ‰ per {unit} at least, up to ±{:.3} {unit}",
            calibrated.curve.max_torque()
        ),
        format!("residual {:.1} ‰ RMS, {:.1} ‰ at most", residuals.rms, residuals.largest),
        format!("each sample left out: {:.1} ‰ RMS", residuals.left_out_rms),
        format!(
            "hysteresis {:.3} {unit}, {:.1} ‰ on average",
            hysteresis.mean_torque, hysteresis.mean_per_mille
        ),
    ]
}

/// Places from one torque to another.
fn along(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..=POINTS).map(move |place| from + (to - from) * f64::from(place) / f64::from(POINTS))
}
