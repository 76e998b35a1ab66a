//! Polynomial of given powers of the torque through samples, with its residuals.

use nalgebra::{DMatrix, DVector};

use crate::fit::sample::Sample;
use crate::least_squares;

/// Powers of the paper's curve (4.2): of 5th order, symmetric about the origin.
pub(super) const ODD: [u8; 3] = [1, 3, 5];
/// Powers of a manufacturer's curve: a straight line.
const LINE: [u8; 1] = [1];
/// Powers of the curve of one driving direction, whose even part is the hysteresis.
pub(super) const QUINTIC: [u8; 6] = [0, 1, 2, 3, 4, 5];

/// Residuals of samples from a fit, in ‰ of rated torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// Root mean square of all residuals.
    pub rms: f64,
    /// Largest absolute residual.
    pub largest: f64,
    /// Root mean square if each sample is predicted from all others (leave-one-out cross-validation).
    pub left_out_rms: f64,
}

impl Residuals {
    /// Computes the residuals of a least-squares solution.
    pub(super) fn from_solution(solution: &least_squares::Solution) -> Self {
        Self {
            rms: rms(&solution.residuals),
            largest: solution.residuals.amax(),
            left_out_rms: rms(&solution.left_out),
        }
    }
}

/// Polynomial of `P` powers of the torque, fitted to samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polynomial<const P: usize> {
    powers: [u8; P],
    /// Coefficients, in ‰ per N·m to each power.
    pub coefficients: [f64; P],
    /// Residuals of the samples, in ‰.
    pub residuals: Residuals,
}

impl<const P: usize> Polynomial<P> {
    /// Returns the target in ‰ of rated torque at a joint torque in N·m.
    pub fn at(&self, torque: f64) -> f64 {
        let terms = self.coefficients.iter().zip(self.powers);
        terms.map(|(c, power)| c * torque.powi(i32::from(power))).sum()
    }

    /// Fits a polynomial of `powers`; `None` unless the samples determine it without any one of them.
    pub(super) fn fit(samples: &[Sample], powers: [u8; P]) -> Option<Self> {
        let scale = samples.iter().map(|sample| sample.torque.abs()).fold(0.0, f64::max);
        let a = columns(samples.iter().map(|sample| sample.torque / scale), powers);
        let b = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.per_mille));
        let solution = least_squares::solve(&a, &b)?;
        let coefficients = unscaled(solution.unknowns.iter(), scale, powers);
        Some(Self { powers, coefficients, residuals: Residuals::from_solution(&solution) })
    }
}

impl Polynomial<3> {
    /// Creates the paper's polynomial from the coefficients of a search.
    pub(super) const fn found(coefficients: [f64; 3], residuals: Residuals) -> Self {
        Self { powers: ODD, coefficients, residuals }
    }
}

/// Fits the paper's polynomial `c1 t + c3 t³ + c5 t⁵` to samples of any driving direction, without friction; `None` unless
/// they determine it.
pub fn odd(samples: &[Sample]) -> Option<Polynomial<3>> {
    Polynomial::fit(samples, ODD)
}

/// Fits the straight line `c1 t` to samples; `None` unless they determine it.
pub fn line(samples: &[Sample]) -> Option<Polynomial<1>> {
    Polynomial::fit(samples, LINE)
}

/// Returns a matrix with a row per number and a column per power.
pub(super) fn columns<const P: usize>(
    numbers: impl ExactSizeIterator<Item = f64>,
    powers: [u8; P],
) -> DMatrix<f64> {
    let rows = numbers.len();
    let terms = numbers.flat_map(|number| powers.map(|power| number.powi(i32::from(power))));
    DMatrix::from_row_iterator(rows, P, terms)
}

/// Converts coefficients of torques divided by `scale` to those of torques.
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

/// Returns the root mean square.
pub(super) fn rms(numbers: &DVector<f64>) -> f64 {
    numbers.map(|number| number * number).mean().sqrt()
}
