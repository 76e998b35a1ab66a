//! All of a joint's samples to its curve, with the evidence for and against it.

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

/// Samples in each driving direction, two more than a quintic has coefficients.
const LEAST: usize = 8;
/// Parts of the range, at whose ends the distance of the directions is looked at.
const PARTS: u16 = 200;
/// Resolution of the end of a range: steps per N·m.
const ENDS: f64 = 1e6;
/// Standard deviations and part of the range by which friction must differ from zero to be below it.
pub(super) const EXCHANGED: (f64, f64) = (3.0, 1e-3);

/// Dry friction of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DryFriction {
    /// In N·m. Below zero: samples driven up lie below those driven down, as if the directions were exchanged.
    pub torque: f64,
    /// Standard deviation, in N·m.
    pub deviation: f64,
    /// Target that overcomes it at zero torque, in ‰ of rated torque.
    pub per_mille: f64,
    /// Largest distance of the measured directions within the range, in N·m at one target: twice the friction,
    /// if friction is the same everywhere.
    #[serde(skip)]
    pub widest: f64,
}

impl DryFriction {
    /// Width of the hysteresis that it causes, in N·m.
    pub const fn hysteresis(&self) -> f64 {
        2.0 * self.torque
    }
}

/// A joint's torque curve with the evidence for and against it.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// The curve, proven to rise over the calibrated range: where both directions were measured, on
    /// both sides of zero.
    pub curve: TorqueCurve,
    /// Motor turns against the joint: the curve is that of the targets' negatives, and `gear_ratio` must
    /// be negative.
    pub is_reversed: bool,
    /// Through all samples but the outliers; `curve` has its coefficients.
    pub both: Polynomial<3>,
    /// Through those driven up alone, with the friction of both.
    pub up: Polynomial<3>,
    /// Through those driven down alone, likewise.
    pub down: Polynomial<3>,
    /// The best straight line through all, to compare with.
    pub line: Polynomial<1>,
    /// The middle of the samples driven up, symmetric or not, with their friction.
    pub branch_up: Polynomial<6>,
    /// The middle of the samples driven down, likewise.
    pub branch_down: Polynomial<6>,
    /// Friction that shifts the directions apart.
    pub friction: DryFriction,
    /// Number of samples, outliers included.
    pub samples: usize,
    /// Samples left out of all this.
    pub outliers: Vec<Outlier>,
    /// Difference between the sides of zero torque.
    pub unevenness: Unevenness,
}

/// Reason why samples give no torque curve.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum NotCalibrated {
    /// NaN or infinite.
    #[error("sample {place} is not finite")]
    NotFinite {
        /// Which, from 1.
        place: usize,
    },
    /// No sample in one driving direction.
    #[error("no sample was driven {0}")]
    DirectionMissing(Direction),
    /// Too few samples in one driving direction.
    #[error("{found} samples driven {direction}, and at least {LEAST} are needed")]
    TooFew {
        /// Which way.
        direction: Direction,
        /// Number of samples.
        found: usize,
    },
    /// Symmetry about the origin needs samples on both sides of it.
    #[error("all samples driven {direction} lie on one side of zero torque")]
    OneSided {
        /// Which way.
        direction: Direction,
    },
    /// Many samples, few torques.
    #[error("the samples driven {direction} have too few different torques for a 5th order")]
    Undetermined {
        /// Which way.
        direction: Direction,
    },
    /// The polynomial is no torque curve.
    #[error("{0}")]
    NoCurve(#[from] InvalidTorqueCurve),
}

impl Calibrated {
    /// Fits one joint's samples.
    ///
    /// # Errors
    /// When they do not determine a curve in both driving directions, or it does not rise all the way.
    pub fn fit(samples: &[Sample]) -> Result<Self, NotCalibrated> {
        let (all, is_reversed) = along_the_joint(samples)?;
        let ways = [Direction::Up, Direction::Down];
        let [all_up, all_down] = ways.map(|direction| branch(&all, direction));
        let (all_up, all_down) = (all_up?, all_down?);
        // What determines a quintic in one direction determines these in both.
        let undetermined = NotCalibrated::Undetermined { direction: Direction::Up };
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
            Polynomial::fit(&one_way, ODD).ok_or(NotCalibrated::Undetermined { direction })
        });
        let end = (range(&at_motor) * ENDS).round() / ENDS;
        let curve = TorqueCurve::new(dry.polynomial.coefficients, end)?;
        let unevenness = Unevenness::of(&dry, &kept, curve.max_torque());
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

    /// Distance of the samples from another curve within its range, in ‰ RMS, without outliers and friction;
    /// `None` if all are outside, or any is not finite.
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

/// Returns the samples that are not kept, with their distances from where the curve has their targets.
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

/// Returns the fit without friction if its friction is below zero by noise alone.
fn not_below_zero(dry: Dry, samples: &[Sample]) -> Option<Dry> {
    let (deviations, part) = EXCHANGED;
    let noise = (deviations * dry.deviation).max(part * range(samples));
    if (-noise..0.0).contains(&dry.friction) { dry.without_friction(samples) } else { Some(dry) }
}

/// Largest distance of two branches over the whole range of `curve`, whose slope turns ‰ into N·m. Where it is
/// `2 friction`, the branches meet once they are shifted by it.
fn widest(up: &Polynomial<6>, down: &Polynomial<6>, curve: &TorqueCurve, friction: f64) -> f64 {
    let widths = (0..=PARTS).map(|place| {
        let part = 2.0 * f64::from(place) / f64::from(PARTS) - 1.0;
        let torque = part * curve.max_torque();
        let apart = up.at(torque - friction) - down.at(torque + friction);
        (2.0 * friction + apart / curve.slope(torque)).abs()
    });
    widths.fold(0.0, f64::max)
}

/// The samples with targets that rise with the torque, and whether they had to be turned round.
fn along_the_joint(samples: &[Sample]) -> Result<(Vec<Sample>, bool), NotCalibrated> {
    let is_finite = |sample: &Sample| sample.torque.is_finite() && sample.per_mille.is_finite();
    if let Some(place) = samples.iter().position(|sample| !is_finite(sample)) {
        return Err(NotCalibrated::NotFinite { place: place + 1 });
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

/// The fit of one driving direction, without symmetry.
fn branch(samples: &[Sample], direction: Direction) -> Result<Polynomial<6>, NotCalibrated> {
    let samples = driven(samples, direction);
    if samples.is_empty() {
        return Err(NotCalibrated::DirectionMissing(direction));
    }
    if samples.len() < LEAST {
        return Err(NotCalibrated::TooFew { direction, found: samples.len() });
    }
    if range(&samples) <= 0.0 {
        return Err(NotCalibrated::OneSided { direction });
    }
    Polynomial::fit(&samples, QUINTIC).ok_or(NotCalibrated::Undetermined { direction })
}
