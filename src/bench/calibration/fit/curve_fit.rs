//! Fit of a joint's samples to its torque curve, with figures of its quality.

use nalgebra::DVector;
use serde::Serialize;
use thiserror::Error;

use crate::fit::dry::{self, Dry};
use crate::fit::polynomial::{ODD, Polynomial, QUINTIC, line, rms};
use crate::fit::robust::chosen;
use crate::fit::sample::{Direction, Outlier, Sample, range};
use crate::fit::selection;
use crate::fit::uneven::Unevenness;
use controller::torque_curve::{InvalidTorqueCurve, TorqueCurve};

/// Minimum number of samples in each driving direction: two more than a quintic has coefficients.
const LEAST: usize = 8;
/// Number of steps of the range at which the distance of the directions is evaluated.
const PARTS: u16 = 200;
/// Resolution of the end of a range, in steps per N·m.
const ENDS: f64 = 1e6;
/// Minimum size of negative friction that is not noise: in standard deviations, and as a part of the range.
pub(super) const EXCHANGED: (f64, f64) = (3.0, 1e-3);

/// Dry friction of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DryFriction {
    /// Friction in N·m. Negative if samples driven up lie below those driven down: the directions may be exchanged.
    pub torque: f64,
    /// Standard deviation of the friction, in N·m.
    pub deviation: f64,
    /// Target that overcomes the friction at zero torque, in ‰ of rated torque.
    pub per_mille: f64,
    /// Largest distance of the measured directions within the range, in N·m at one target: twice the friction,
    /// if friction is the same everywhere.
    #[serde(skip)]
    pub widest: f64,
}

impl DryFriction {
    /// Returns the width of the hysteresis caused by the friction, in N·m.
    pub const fn hysteresis(&self) -> f64 {
        2.0 * self.torque
    }
}

/// Fitted torque curve of a joint (4.2, Fig. 6), with figures of its quality.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveFit {
    /// Curve, which rises over the calibrated range. The range is that of both directions on both sides of zero.
    pub curve: TorqueCurve,
    /// Set if the motor turns against the joint: the curve has the negated targets, and `gear_ratio` must be negative.
    pub is_reversed: bool,
    /// Polynomial through all samples except outliers; `curve` has its coefficients.
    pub both: Polynomial<3>,
    /// Polynomial through the samples driven up, with the friction of both directions.
    pub up: Polynomial<3>,
    /// Polynomial through the samples driven down, with the friction of both directions.
    pub down: Polynomial<3>,
    /// Straight line through all samples except outliers, for comparison.
    pub line: Polynomial<1>,
    /// Quintic through the samples driven up, friction included, without symmetry.
    pub branch_up: Polynomial<6>,
    /// Quintic through the samples driven down, friction included, without symmetry.
    pub branch_down: Polynomial<6>,
    /// Dry friction, half the distance of the two directions.
    pub friction: DryFriction,
    /// Number of samples, outliers included.
    pub samples: usize,
    /// Samples excluded from the fit.
    pub outliers: Vec<Outlier>,
    /// Difference between the sides of zero torque.
    pub unevenness: Unevenness,
}

/// Reason why samples give no torque curve.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum NoTorqueCurve {
    /// NaN or infinity in a sample.
    #[error("sample {place} is not finite")]
    NotFinite {
        /// Number of the sample, from 1.
        place: usize,
    },
    /// No sample in one driving direction.
    #[error("no sample was driven {0}")]
    DirectionMissing(Direction),
    /// Too few samples in one driving direction.
    #[error("{found} samples driven {direction}, and at least {LEAST} are needed")]
    TooFew {
        /// Driving direction.
        direction: Direction,
        /// Number of samples.
        found: usize,
    },
    /// No samples on one side of zero torque; symmetry about the origin needs both.
    #[error("all samples driven {direction} lie on one side of zero torque")]
    OneSided {
        /// Driving direction.
        direction: Direction,
    },
    /// Too few different torques for a quintic.
    #[error("the samples driven {direction} have too few different torques for a 5th order")]
    Undetermined {
        /// Driving direction.
        direction: Direction,
    },
    /// Polynomial that does not rise over the calibrated range.
    #[error("{0}")]
    NoCurve(#[from] InvalidTorqueCurve),
}

impl CurveFit {
    /// Fits one joint's samples.
    ///
    /// # Errors
    /// Returns an error if the samples do not determine a curve in both driving directions, or it does not rise over
    /// their range.
    pub fn fit(samples: &[Sample]) -> Result<Self, NoTorqueCurve> {
        let (all, is_reversed) = along_the_joint(samples)?;
        let ways = [Direction::Up, Direction::Down];
        let [all_up, all_down] = ways.map(|direction| branch(&all, direction));
        let (all_up, all_down) = (all_up?, all_down?);
        // Samples that determine a quintic per direction also determine the polynomial, friction and line of both.
        let undetermined = NoTorqueCurve::Undetermined { direction: Direction::Up };
        let selection = selection::select(&all).ok_or(undetermined)?;
        let kept = chosen(&all, &selection.is_kept);
        let [branch_up, branch_down] = ways.map(|direction| branch(&kept, direction));
        let (branch_up, branch_down) =
            (branch_up.unwrap_or(all_up), branch_down.unwrap_or(all_down));
        let dry = not_below_zero(selection.dry, &kept).ok_or(undetermined)?;
        let line = line(&kept).ok_or(undetermined)?;
        let at_motor: Vec<Sample> = kept.iter().map(|sample| dry.at_motor(sample)).collect();
        let [up, down] = ways.map(|direction| {
            let one_way = driven(&at_motor, direction);
            Polynomial::fit(&one_way, ODD).ok_or(NoTorqueCurve::Undetermined { direction })
        });
        let end = (range(&at_motor) * ENDS).round() / ENDS;
        let curve = TorqueCurve::new(dry.polynomial.coefficients, end)?;
        let unevenness = Unevenness::compare(&dry, &kept, curve.max_torque());
        Ok(Self {
            is_reversed,
            both: dry.polynomial,
            up: up?,
            down: down?,
            line,
            friction: DryFriction {
                torque: dry.friction,
                deviation: dry.deviation,
                per_mille: dry.friction * curve.slope(0.0),
                widest: widest(&branch_up, &branch_down, &curve, dry.friction),
            },
            branch_up,
            branch_down,
            samples: all.len(),
            outliers: outliers(&all, &selection.is_kept, dry.friction, &curve),
            unevenness,
            curve,
        })
    }

    /// Returns the RMS distance of the samples from `curve` within its range, in ‰, without outliers and friction. `None` if
    /// all are outside, or any is not finite.
    pub fn distance(&self, samples: &[Sample], curve: &TorqueCurve) -> Option<f64> {
        let (samples, _) = along_the_joint(samples).ok()?;
        let is_outlier = |place: usize| self.outliers.iter().any(|other| other.place == place);
        let kept = samples.iter().enumerate().filter(|(place, _)| !is_outlier(*place));
        let motor = kept.map(|(_, sample)| dry::shifted(sample, self.friction.torque));
        let within = motor.filter(|sample| sample.torque.abs() <= curve.max_torque());
        let misses: Vec<f64> = within.map(|s| s.per_mille - curve.at(s.torque)).collect();
        (!misses.is_empty()).then(|| rms(&DVector::from_vec(misses)))
    }
}

/// Returns the samples that are not kept, with their distances in N·m from the curve at their targets.
fn outliers(
    samples: &[Sample],
    is_kept: &[bool],
    friction: f64,
    curve: &TorqueCurve,
) -> Vec<Outlier> {
    let all = samples.iter().zip(is_kept).enumerate();
    let left_out = all.filter(|(_, (_, is_kept))| !**is_kept);
    let outliers = left_out.map(|(place, (sample, _))| {
        let distance = dry::shifted(sample, friction).torque - curve.torque(sample.per_mille);
        Outlier { place, distance }
    });
    outliers.collect()
}

/// Returns the fit, or that without friction if its friction is negative within noise.
fn not_below_zero(dry: Dry, samples: &[Sample]) -> Option<Dry> {
    let (deviations, part) = EXCHANGED;
    let noise = (deviations * dry.deviation).max(part * range(samples));
    if (-noise..0.0).contains(&dry.friction) { dry.without_friction(samples) } else { Some(dry) }
}

/// Returns the largest distance of two branches over the range of `curve`, in N·m by its slope. It is `2 friction` if the
/// branches meet after a shift by `friction`.
fn widest(up: &Polynomial<6>, down: &Polynomial<6>, curve: &TorqueCurve, friction: f64) -> f64 {
    let widths = (0..=PARTS).map(|place| {
        let part = 2.0 * f64::from(place) / f64::from(PARTS) - 1.0;
        let torque = part * curve.max_torque();
        let apart = up.at(torque - friction) - down.at(torque + friction);
        (2.0 * friction + apart / curve.slope(torque)).abs()
    });
    widths.fold(0.0, f64::max)
}

/// Returns the samples with targets that rise with the torque, and whether the targets were negated.
fn along_the_joint(samples: &[Sample]) -> Result<(Vec<Sample>, bool), NoTorqueCurve> {
    let is_finite = |sample: &Sample| sample.torque.is_finite() && sample.per_mille.is_finite();
    if let Some(place) = samples.iter().position(|sample| !is_finite(sample)) {
        return Err(NoTorqueCurve::NotFinite { place: place + 1 });
    }
    let trend: f64 = samples.iter().map(|sample| sample.torque * sample.per_mille).sum();
    let sign = if trend < 0.0 { -1.0 } else { 1.0 };
    let turned = samples.iter().map(|s| Sample { per_mille: sign * s.per_mille, ..*s });
    Ok((turned.collect(), trend < 0.0))
}

/// Returns the samples driven in one direction.
fn driven(samples: &[Sample], direction: Direction) -> Vec<Sample> {
    samples.iter().filter(|sample| sample.direction == direction).copied().collect()
}

/// Fits a quintic to the samples of one driving direction.
fn branch(samples: &[Sample], direction: Direction) -> Result<Polynomial<6>, NoTorqueCurve> {
    let samples = driven(samples, direction);
    if samples.is_empty() {
        return Err(NoTorqueCurve::DirectionMissing(direction));
    }
    if samples.len() < LEAST {
        return Err(NoTorqueCurve::TooFew { direction, found: samples.len() });
    }
    if range(&samples) <= 0.0 {
        return Err(NoTorqueCurve::OneSided { direction });
    }
    Polynomial::fit(&samples, QUINTIC).ok_or(NoTorqueCurve::Undetermined { direction })
}
