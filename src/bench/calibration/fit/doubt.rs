//! Reasons not to accept a fitted curve, each with its figure and a remedy.
//!
//! A curve may fit badly, or fit readings with a systematic error: exchanged directions, an offset, another joint.

use crate::fit::curve_fit::{CurveFit, EXCHANGED};
use crate::fit::uneven::Unevenness;
use controller::torque_curve::TorqueCurve;

/// Maximum share of outliers among the readings.
const MAX_OUTLIERS: f64 = 0.02;
/// Maximum even part, relative to the end of the curve.
const MAX_UNEVENNESS: f64 = 0.02;
/// Maximum RMS residual of left-out readings (cross-validation), relative to the end of the curve.
const MAX_LEFT_OUT: f64 = 0.02;
/// Maximum ratio of a range or slope to the configured one, or of the configured one to it.
const MAX_RATIO: f64 = 3.0;

/// Reason not to accept a fitted curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// Samples driven up lie below those driven down.
    DirectionsExchanged {
        /// Fitted friction, in N·m; negative.
        friction: f64,
    },
    /// Too many readings are outliers.
    Outliers {
        /// Number of outliers.
        found: usize,
        /// Number of readings.
        of: usize,
    },
    /// Offset of the load cell.
    CellOffset {
        /// Offset in N·m.
        offset: f64,
        /// Even part relative to the end of the curve.
        share: f64,
    },
    /// Targets on one side of zero give less torque.
    WeakerSide {
        /// Torque of the positive side relative to the negative one at the same target.
        strength: f64,
        /// Even part relative to the end of the curve.
        share: f64,
    },
    /// Left-out readings that the curve does not predict (cross-validation).
    LeftOut {
        /// RMS residual, relative to the end of the curve.
        share: f64,
    },
    /// Range or slope differ from the configured ones by more than a factor of three.
    Scale {
        /// Range in N·m: measured, configured.
        range: [f64; 2],
        /// Slope at zero in ‰ per N·m: measured, configured.
        slope: [f64; 2],
    },
}

impl CurveFit {
    /// Returns the doubts that follow from the readings alone, the most obvious first.
    pub fn doubts(&self) -> Vec<Doubt> {
        let end = self.curve.at(self.curve.max_torque());
        let left_out = self.both.residuals.left_out_rms / end;
        let uneven = self.uneven();
        // A difference of the sides already explains residuals of an odd curve.
        let is_unexplained = left_out > MAX_LEFT_OUT && uneven.is_none();
        let left_out = is_unexplained.then_some(Doubt::LeftOut { share: left_out });
        [self.exchange(), self.excess(), uneven, left_out].into_iter().flatten().collect()
    }

    /// Returns a doubt if range or slope differ from those of the `configured` curve by more than a factor of three.
    pub fn doubt_against(&self, configured: &TorqueCurve) -> Option<Doubt> {
        let range = [self.curve.max_torque(), configured.max_torque()];
        let slope = [self.curve.slope(0.0), configured.slope(0.0)];
        let is_far = |[measured, configured]: [f64; 2]| {
            !(1.0 / MAX_RATIO..=MAX_RATIO).contains(&(measured / configured))
        };
        (is_far(range) || is_far(slope)).then_some(Doubt::Scale { range, slope })
    }

    fn exchange(&self) -> Option<Doubt> {
        let (deviations, part) = EXCHANGED;
        let friction = self.friction.torque;
        let noise = (deviations * self.friction.deviation).max(part * self.curve.max_torque());
        (friction < -noise).then_some(Doubt::DirectionsExchanged { friction })
    }

    fn excess(&self) -> Option<Doubt> {
        let (found, of) = (self.outliers.len(), self.samples);
        let share = count(found) / count(of);
        (share > MAX_OUTLIERS).then_some(Doubt::Outliers { found, of })
    }

    fn uneven(&self) -> Option<Doubt> {
        let Unevenness { share, is_offset, offset, strength } = self.unevenness;
        (share > MAX_UNEVENNESS).then_some(if is_offset {
            Doubt::CellOffset { offset, share }
        } else {
            Doubt::WeakerSide { strength, share }
        })
    }
}

impl Doubt {
    /// Returns reason and remedy, with torques in `unit`: `N·m`, or `N` for a prismatic joint.
    pub fn reason(&self, unit: &str) -> String {
        let percent = |share: f64| 100.0 * share;
        match *self {
            Self::DirectionsExchanged { friction } => format!(
                "readings driven up lie below those driven down by {:.4} {unit}; exchange up and down",
                -2.0 * friction
            ),
            Self::Outliers { found, of } => format!(
                "{found} of {of} readings are outliers, at most 2 % may be; measure their lines again"
            ),
            Self::CellOffset { offset, share } => format!(
                "the load cell has an offset of {offset:+.4} {unit}, which bends the curve by {:.1} % of its end \
                 (at most 2 %); zero the load cell",
                percent(share)
            ),
            Self::WeakerSide { strength, share } => format!(
                "the {} side exerts {:.1} % less torque than the other, which bends the curve by {:.1} % of its end \
                 (at most 2 %); look for what holds it on one side",
                if strength < 1.0 { "positive" } else { "negative" },
                percent(1.0 - strength.min(1.0 / strength)),
                percent(share)
            ),
            Self::LeftOut { share } => format!(
                "the curve misses readings left out by {:.1} % of its end, RMS (at most 2 %); look at the \
                 residuals, and measure with less noise or in smaller steps",
                percent(share)
            ),
            Self::Scale { range: [range, configured_range], slope: [slope, configured_slope] } => {
                format!(
                    "range {range:.4} {unit} and slope {slope:.4} ‰/{unit} are more than 3 times off the configured \
                     {configured_range} {unit} and {configured_slope:.4} ‰/{unit}; are the readings in {unit}? \
                     Are the targets in ‰?"
                )
            }
        }
    }
}

/// Converts a number of readings to `f64`; infinity beyond `u32`.
fn count(readings: usize) -> f64 {
    u32::try_from(readings).map_or(f64::INFINITY, f64::from)
}
