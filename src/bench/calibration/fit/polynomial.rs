//! A polynomial of some powers of the torque through samples, and how far they lie from it.

use nalgebra::{DMatrix, DVector};

use crate::fit::sample::Sample;
use crate::least_squares;

/// The paper's curve: symmetric about the origin, of 5th order.
pub(super) const ODD: [u8; 3] = [1, 3, 5];
/// A manufacturer's.
const LINE: [u8; 1] = [1];
/// One driving direction alone is not symmetric about the origin: its even part is its hysteresis.
pub(super) const QUINTIC: [u8; 6] = [0, 1, 2, 3, 4, 5];

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

impl Residuals {
    /// Returns them of a least-squares solution.
    pub(super) fn of(solution: &least_squares::Solution) -> Self {
        Self {
            rms: rms(&solution.residuals),
            largest: solution.residuals.amax(),
            left_out_rms: rms(&solution.left_out),
        }
    }
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
    pub(super) fn fit(samples: &[Sample], powers: [u8; P]) -> Option<Self> {
        let scale = samples.iter().map(|sample| sample.torque.abs()).fold(0.0, f64::max);
        let a = columns(samples.iter().map(|sample| sample.torque / scale), powers);
        let b = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.per_mille));
        let solution = least_squares::solve(&a, &b)?;
        let coefficients = unscaled(solution.unknowns.iter(), scale, powers);
        Some(Self { powers, coefficients, residuals: Residuals::of(&solution) })
    }
}

impl Polynomial<3> {
    /// The paper's polynomial with these coefficients, which a search has found.
    pub(super) const fn found(coefficients: [f64; 3], residuals: Residuals) -> Self {
        Self { powers: ODD, coefficients, residuals }
    }
}

/// The paper's polynomial `c1 t + c3 t³ + c5 t⁵` through samples of any driving direction, without
/// friction; `None` unless they determine it.
pub fn odd(samples: &[Sample]) -> Option<Polynomial<3>> {
    Polynomial::fit(samples, ODD)
}

/// The straight line `c1 t` through samples; `None` unless they determine it.
pub fn line(samples: &[Sample]) -> Option<Polynomial<1>> {
    Polynomial::fit(samples, LINE)
}

/// Returns the powers of each number, a row per number.
pub(super) fn columns<const P: usize>(
    numbers: impl ExactSizeIterator<Item = f64>,
    powers: [u8; P],
) -> DMatrix<f64> {
    let rows = numbers.len();
    let terms = numbers.flat_map(|number| powers.map(|power| number.powi(i32::from(power))));
    DMatrix::from_row_iterator(rows, P, terms)
}

/// Returns the coefficients over torques of those over torques divided by `scale`.
pub(super) fn unscaled<'u, const P: usize>(
    scaled: impl Iterator<Item = &'u f64>,
    scale: f64,
    powers: [u8; P],
) -> [f64; P] {
    let mut coefficients = [0.0; P];
    for (coefficient, (scaled, power)) in coefficients.iter_mut().zip(scaled.zip(powers)) {
        *coefficient = scaled / scale.powi(i32::from(power));
    }
    coefficients
}

/// Root mean square.
pub(super) fn rms(numbers: &DVector<f64>) -> f64 {
    numbers.map(|number| number * number).mean().sqrt()
}
