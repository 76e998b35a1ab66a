//! A torque curve from measurements (4.2, Fig. 6): odd least squares of 5th order over both driving
//! directions, how well it fits, and how far the two directions lie apart.
//!
//! Not where the measurements come from. Targets are fitted over torques, since that is how the curve
//! is used: the torque is wanted, the target is sought. The abscissa is scaled to its largest value, so
//! that its fifth power is of like size.
//!
//! Dry friction shifts the two directions apart along the torque, and the curve runs in the middle
//! between them. That a hysteresis of width w shifts abscissae by ±w/2 bends it a little, on a range R
//! by less than (w/R)² of its end: 0.04 % at w = 0.02 R.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::least_squares;
use crate::torque_curve::{InvalidTorqueCurve, TorqueCurve};

/// The paper's curve: symmetric about the origin, of 5th order.
const ODD: [u8; 3] = [1, 3, 5];
/// A manufacturer's.
const LINE: [u8; 1] = [1];
/// One driving direction alone is not symmetric about the origin: its even part is its hysteresis.
const QUINTIC: [u8; 6] = [0, 1, 2, 3, 4, 5];
/// Samples in each driving direction, two more than a quintic has coefficients.
const LEAST: usize = 8;
/// Parts of the range, at whose ends the hysteresis is looked at.
const PARTS: u16 = 200;

/// Which way a joint was driven when a sample was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Its torque rose.
    Up,
    /// Its torque fell.
    Down,
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Up => "up",
            Self::Down => "down",
        })
    }
}

/// One measurement at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Load cell reading, in N·m at the joint (N for a sliding joint).
    pub torque: f64,
    /// Target torque (6071h), in ‰ of rated torque.
    pub per_mille: f64,
    /// Which way the joint was driven.
    pub direction: Direction,
}

/// Distance of samples from a fit, in ‰ of rated torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// Root mean square.
    pub rms: f64,
    /// The largest.
    pub largest: f64,
    /// Root mean square if each sample is predicted from all others.
    pub left_out_rms: f64,
}

/// A polynomial of some powers of the torque, fitted to samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polynomial<const P: usize> {
    powers: [u8; P],
    /// In ‰ per N·m to each power.
    pub coefficients: [f64; P],
    /// Quality of the fit.
    pub residuals: Residuals,
}

impl<const P: usize> Polynomial<P> {
    /// ‰ of rated torque at a joint torque in N·m.
    pub fn at(&self, torque: f64) -> f64 {
        let terms = self.coefficients.iter().zip(self.powers);
        terms.map(|(c, power)| c * torque.powi(i32::from(power))).sum()
    }

    /// The best one of `powers`; `None` unless the samples determine it, whichever is left out.
    fn fit(samples: &[Sample], powers: [u8; P]) -> Option<Self> {
        let scale = samples.iter().map(|sample| sample.torque.abs()).fold(0.0, f64::max);
        let terms = samples
            .iter()
            .flat_map(|sample| powers.map(|power| (sample.torque / scale).powi(i32::from(power))));
        let a = DMatrix::from_row_iterator(samples.len(), P, terms);
        let b = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.per_mille));
        let solution = least_squares::solve(&a, &b)?;
        let mut coefficients = [0.0; P];
        let scaled = solution.unknowns.iter().zip(powers);
        for (coefficient, (scaled, power)) in coefficients.iter_mut().zip(scaled) {
            *coefficient = scaled / scale.powi(i32::from(power));
        }
        let residuals = Residuals {
            rms: rms(&solution.residuals),
            largest: solution.residuals.amax(),
            left_out_rms: rms(&solution.left_out),
        };
        Some(Self { powers, coefficients, residuals })
    }
}

/// The paper's polynomial `c1 t + c3 t³ + c5 t⁵` through samples of any driving direction; `None` unless
/// they determine it.
pub fn odd(samples: &[Sample]) -> Option<Polynomial<3>> {
    Polynomial::fit(samples, ODD)
}

/// The straight line `c1 t` through samples; `None` unless they determine it.
pub fn line(samples: &[Sample]) -> Option<Polynomial<1>> {
    Polynomial::fit(samples, LINE)
}

/// Distance of samples from a curve within its range, in ‰ RMS; `None` if all are outside, or any is not
/// finite. The sign of the gear ratio does not matter.
pub fn distance(samples: &[Sample], curve: &TorqueCurve) -> Option<f64> {
    let (samples, _) = along_the_joint(samples).ok()?;
    let within = samples.iter().filter(|sample| sample.torque.abs() <= curve.max_torque());
    let misses: Vec<f64> = within.map(|s| s.per_mille - curve.at(s.torque)).collect();
    (!misses.is_empty()).then(|| rms(&DVector::from_vec(misses)))
}

/// Distance of the two driving directions within the calibrated range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hysteresis {
    /// Mean width, in ‰ of rated torque at one torque.
    pub mean_per_mille: f64,
    /// Largest width, likewise.
    pub largest_per_mille: f64,
    /// Mean width, in N·m at one target: twice the dry friction, if there is nothing else.
    pub mean_torque: f64,
    /// Largest width, likewise.
    pub largest_torque: f64,
}

/// A joint's torque curve with the evidence for and against it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated {
    /// The curve, proven to rise over the calibrated range: where both directions were measured, on
    /// both sides of zero.
    pub curve: TorqueCurve,
    /// Motor turns against the joint: the curve is that of the targets' negatives, and `gear_ratio` must
    /// be negative.
    pub is_reversed: bool,
    /// Through all samples; `curve` has its coefficients.
    pub both: Polynomial<3>,
    /// Through those driven up alone.
    pub up: Polynomial<3>,
    /// Through those driven down alone.
    pub down: Polynomial<3>,
    /// The best straight line through all, to compare with.
    pub line: Polynomial<1>,
    /// The middle of the samples driven up, symmetric or not.
    pub branch_up: Polynomial<6>,
    /// The middle of the samples driven down, likewise.
    pub branch_down: Polynomial<6>,
    /// Distance of the branches.
    pub hysteresis: Hysteresis,
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
        let (samples, is_reversed) = along_the_joint(samples)?;
        let [(up, branch_up), (down, branch_down)] =
            [one_way(&samples, Direction::Up)?, one_way(&samples, Direction::Down)?];
        // What determines a quintic in one direction determines these in both.
        let undetermined = NotCalibrated::Undetermined { direction: Direction::Up };
        let both = odd(&samples).ok_or(undetermined)?;
        let line = line(&samples).ok_or(undetermined)?;
        let curve = TorqueCurve::new(both.coefficients, range(&samples))?;
        let hysteresis = Hysteresis::between(&branch_up, &branch_down, &curve);
        Ok(Self { curve, is_reversed, both, up, down, line, branch_up, branch_down, hysteresis })
    }
}

impl Hysteresis {
    /// Over the whole range of `curve`, whose slope turns ‰ into N·m.
    fn between(up: &Polynomial<6>, down: &Polynomial<6>, curve: &TorqueCurve) -> Self {
        let none = Self {
            mean_per_mille: 0.0,
            largest_per_mille: 0.0,
            mean_torque: 0.0,
            largest_torque: 0.0,
        };
        let places = f64::from(PARTS) + 1.0;
        (0..=PARTS).fold(none, |so_far, place| {
            let part = 2.0 * f64::from(place) / f64::from(PARTS) - 1.0;
            let torque = part * curve.max_torque();
            let per_mille = (up.at(torque) - down.at(torque)).abs();
            let width = per_mille / curve.slope(torque);
            Self {
                mean_per_mille: so_far.mean_per_mille + per_mille / places,
                largest_per_mille: so_far.largest_per_mille.max(per_mille),
                mean_torque: so_far.mean_torque + width / places,
                largest_torque: so_far.largest_torque.max(width),
            }
        })
    }
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

/// The fits of one driving direction: odd, and without symmetry.
fn one_way(
    samples: &[Sample],
    direction: Direction,
) -> Result<(Polynomial<3>, Polynomial<6>), NotCalibrated> {
    let is_driven = |sample: &&Sample| sample.direction == direction;
    let samples: Vec<Sample> = samples.iter().filter(is_driven).copied().collect();
    if samples.is_empty() {
        return Err(NotCalibrated::DirectionMissing(direction));
    }
    if samples.len() < LEAST {
        return Err(NotCalibrated::TooFew { direction, found: samples.len() });
    }
    if range(&samples) <= 0.0 {
        return Err(NotCalibrated::OneSided { direction });
    }
    let fits = odd(&samples).zip(Polynomial::fit(&samples, QUINTIC));
    fits.ok_or(NotCalibrated::Undetermined { direction })
}

/// Range within which both directions were measured on both sides of zero, in N·m.
fn range(samples: &[Sample]) -> f64 {
    let reach = |direction, sign: f64| {
        let of = samples.iter().filter(|sample| sample.direction == direction);
        of.map(|sample| sign * sample.torque).reduce(f64::max)
    };
    let ways = [Direction::Up, Direction::Down];
    let reaches = ways.into_iter().flat_map(|way| [reach(way, 1.0), reach(way, -1.0)]);
    reaches.flatten().reduce(f64::min).unwrap_or(0.0)
}

fn rms(residuals: &DVector<f64>) -> f64 {
    residuals.map(|residual| residual * residual).mean().sqrt()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const CURVE: [f64; 3] = [133.144, -0.393_453, 0.019_672_6];
    const FRICTION: f64 = 0.06;

    fn curve(t: f64) -> f64 {
        let [c1, c3, c5] = CURVE;
        c1 * t + c3 * t.powi(3) + c5 * t.powi(5)
    }

    /// Up and down between ±6 N·m in `steps` steps, with friction; `noise` is added to each torque.
    fn sweep(steps: u16, friction: f64, mut noise: impl FnMut() -> f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        for (direction, lag) in [(Direction::Up, friction), (Direction::Down, -friction)] {
            for step in 0..=steps {
                let torque = 12.0 * f64::from(step) / f64::from(steps) - 6.0;
                let per_mille = curve(torque + lag);
                samples.push(Sample { torque: torque + noise(), per_mille, direction });
            }
        }
        samples
    }

    fn exact() -> Vec<Sample> {
        sweep(24, 0.0, || 0.0)
    }

    #[test]
    fn samples_of_a_curve_give_the_curve() {
        let calibrated = Calibrated::fit(&exact()).unwrap();
        for (fitted, coefficient) in calibrated.curve.coefficients().into_iter().zip(CURVE) {
            assert!((fitted / coefficient - 1.0).abs() < 1e-11, "{fitted} for {coefficient}");
        }
        assert!((calibrated.curve.max_torque() - 6.0).abs() < 1e-12);
        assert!(calibrated.both.residuals.largest < 1e-9);
        assert!(calibrated.hysteresis.largest_torque < 1e-9);
        assert!(!calibrated.is_reversed);
        assert!(calibrated.line.residuals.rms > 5.0);
        let off = TorqueCurve::new([133.144 + 7.0, -0.393_453, 0.019_672_6], 0.5).unwrap();
        // Of the samples at 0 and ±0.5 N·m, two are 3.5 ‰ off.
        let distance = distance(&exact(), &off).unwrap();
        assert!((distance - 3.5 * (2.0_f64 / 3.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_motor_that_turns_against_its_joint_has_the_same_curve() {
        let mut samples = exact();
        for sample in &mut samples {
            sample.per_mille = -sample.per_mille;
        }
        let calibrated = Calibrated::fit(&samples).unwrap();
        assert!(calibrated.is_reversed);
        assert!(distance(&samples, &calibrated.curve).unwrap() < 1e-9);
        assert_eq!(calibrated.curve, Calibrated::fit(&exact()).unwrap().curve);
    }

    #[test]
    fn hysteresis_is_twice_the_friction_around_the_curve() {
        let calibrated = Calibrated::fit(&sweep(48, FRICTION, || 0.0)).unwrap();
        let Hysteresis { mean_torque, largest_torque, .. } = calibrated.hysteresis;
        assert!((mean_torque - 2.0 * FRICTION).abs() < 1e-3, "{mean_torque}");
        assert!((largest_torque - 2.0 * FRICTION).abs() < 3e-3, "{largest_torque}");
        for t in [-6.0, -4.0, -1.0, 0.5, 3.0, 5.9] {
            let error = calibrated.both.at(t) - curve(t);
            assert!(error.abs() < 4e-4 * curve(6.0), "{error} ‰ at {t} N·m");
        }
    }

    #[test]
    fn hysteresis_is_measured_from_end_to_end_of_the_range() {
        // 100 ‰ per N·m; the ways lie 2 (3 + t²/4) ‰ apart, so 24 ‰ at the ends and 12 ‰ in the mean.
        let mut samples = exact();
        for Sample { torque, per_mille, direction } in &mut samples {
            let apart = 3.0 + torque.powi(2) / 4.0;
            let way = if *direction == Direction::Up { 1.0 } else { -1.0 };
            *per_mille = 100.0 * *torque + way * apart;
        }
        let Hysteresis { mean_per_mille, largest_per_mille, mean_torque, largest_torque } =
            Calibrated::fit(&samples).unwrap().hysteresis;
        assert!((largest_per_mille - 24.0).abs() < 1e-6, "{largest_per_mille}");
        assert!((largest_torque - 0.24).abs() < 1e-8, "{largest_torque}");
        // Of places at equal distances, the ends included: a little more than of the integral.
        assert!((12.0..12.1).contains(&mean_per_mille), "{mean_per_mille}");
        assert!((mean_torque - mean_per_mille / 100.0).abs() < 1e-8, "{mean_torque}");
    }

    #[test]
    fn weak_joint_is_not_taken_for_a_reversed_one() {
        let mut samples = exact();
        for sample in &mut samples {
            (sample.torque, sample.per_mille) = (sample.torque * 1e-3, sample.torque / 3.0);
        }
        let calibrated = Calibrated::fit(&samples).unwrap();
        assert!(!calibrated.is_reversed);
        assert!(distance(&samples, &calibrated.curve).unwrap() < 1e-9);
    }

    #[test]
    fn wide_hysteresis_flattens_the_curve_no_more_than_is_said() {
        for friction in [0.1, 0.2, 0.4, 0.6] {
            let calibrated = Calibrated::fit(&sweep(200, friction, || 0.0)).unwrap();
            let range = calibrated.curve.max_torque();
            let bound = (2.0 * friction / range).powi(2);
            for step in 1..=20 {
                let t = range * f64::from(step) / 20.0;
                let error = (calibrated.both.at(t) - curve(t)).abs() / curve(range);
                assert!(error < bound, "friction {friction}: {error} at {t} N·m");
            }
        }
    }

    #[test]
    fn range_ends_where_one_direction_lacks_a_side() {
        let mut samples = exact();
        samples.retain(|s| s.direction == Direction::Up || s.torque > -4.2);
        assert!((Calibrated::fit(&samples).unwrap().curve.max_torque() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn a_curve_that_does_not_rise_is_refused_and_where_is_said() {
        // Slope 100 (1 - 3 u + 2 u²) with u = t² / 16: zero at √8 N·m, below zero up to 4 N·m.
        let flat = |t: f64| 100.0 * (t - t.powi(3) / 16.0 + 0.4 * t.powi(5) / 256.0);
        let mut samples = sweep(24, 0.0, || 0.0);
        for sample in &mut samples {
            sample.per_mille = flat(sample.torque);
        }
        let error = Calibrated::fit(&samples).unwrap_err();
        let NotCalibrated::NoCurve(InvalidTorqueCurve::NotMonotone { torque, .. }) = error else {
            panic!("{error}")
        };
        assert!((torque - 8.0_f64.sqrt()).abs() < 1e-9, "{torque}");
    }

    #[test]
    fn too_little_is_refused_and_what_is_missing_is_said() {
        let refused = |keep: &dyn Fn(&Sample) -> bool| {
            let samples: Vec<Sample> = exact().into_iter().filter(keep).collect();
            Calibrated::fit(&samples).unwrap_err()
        };
        let (up, down) = (Direction::Up, Direction::Down);
        assert_eq!(refused(&|_| false), NotCalibrated::DirectionMissing(up));
        assert_eq!(refused(&|s| s.direction == up), NotCalibrated::DirectionMissing(down));
        assert_eq!(
            refused(&|s| s.direction == up || s.torque.abs() < 1.6),
            NotCalibrated::TooFew { direction: down, found: 7 }
        );
        assert_eq!(refused(&|s| s.torque > 0.2), NotCalibrated::OneSided { direction: up });
        let twice = |torque: f64| {
            let sample = Sample { torque, per_mille: curve(torque), direction: up };
            [sample; 4].into_iter().chain([Sample { direction: down, ..sample }; 4])
        };
        let repeated: Vec<Sample> = [-2.0, 2.0].into_iter().flat_map(twice).collect();
        assert_eq!(
            Calibrated::fit(&repeated).unwrap_err(),
            NotCalibrated::Undetermined { direction: up }
        );
        let mut broken = exact();
        broken[4].torque = f64::NAN;
        assert_eq!(Calibrated::fit(&broken).unwrap_err(), NotCalibrated::NotFinite { place: 5 });
    }

    proptest! {
        #[test]
        fn a_noisy_curve_is_recovered_within_the_stated_error(
            noise in prop::collection::vec(-0.03..0.03_f64, 98)
        ) {
            let mut noise = noise.into_iter();
            let samples = sweep(48, FRICTION, || noise.next().unwrap());
            let calibrated = Calibrated::fit(&samples).unwrap();
            for step in 0..=60 {
                let t = f64::from(step) / 10.0 * calibrated.curve.max_torque() / 6.0;
                let error = (calibrated.both.at(t) - curve(t)).abs();
                prop_assert!(error < calibrated.both.residuals.left_out_rms, "{error} at {t}");
            }
        }

        #[test]
        fn any_samples_give_a_curve_or_a_reason(
            numbers in prop::collection::vec((any::<f64>(), any::<f64>(), any::<bool>()), 0..40)
        ) {
            let samples: Vec<Sample> = numbers.into_iter().map(|(torque, per_mille, is_up)| Sample {
                torque,
                per_mille,
                direction: if is_up { Direction::Up } else { Direction::Down },
            }).collect();
            if let Ok(calibrated) = Calibrated::fit(&samples) {
                prop_assert!(calibrated.curve.least_slope().0 > 0.0);
            }
        }
    }
}
