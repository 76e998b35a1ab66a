//! Polynomials in the delay operator `w = z⁻¹`, with Jury's stability test.
//!
//! Coefficients ascend: `[1, -0.5]` is `1 - 0.5 w`, with its root at `z = 0.5`. Jury's table needs no iteration, so unlike
//! a root finder it cannot fail to converge.

use std::ops::{Add, Mul};

/// Tolerance on the radius of a root: an oscillation within it grows by a factor of e in a quarter of an hour at 1 kHz. A
/// free mass has a root at `z = 1`, which counts as stable.
const TOLERANCE: f64 = 1e-6;

/// Polynomial in `w = z⁻¹`.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial(Vec<f64>);

impl Polynomial {
    /// Creates a polynomial from ascending coefficients.
    pub fn new(coefficients: &[f64]) -> Self {
        Self(coefficients.to_vec())
    }

    /// Multiplies by `wⁿ`: a delay of `cycles`.
    #[must_use]
    pub fn later(mut self, cycles: u32) -> Self {
        let zeros = usize::try_from(cycles).unwrap_or_default();
        self.0.splice(0..0, std::iter::repeat_n(0.0, zeros));
        self
    }

    /// Returns the value at a complex `w`.
    pub fn at(&self, w: nalgebra::Complex<f64>) -> nalgebra::Complex<f64> {
        self.0.iter().rev().fold(nalgebra::Complex::new(0.0, 0.0), |sum, part| sum * w + part)
    }

    /// Returns whether every coefficient is finite.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|part| part.is_finite())
    }

    /// Returns whether all roots have `|z| <= 1`, within `TOLERANCE`. False for coefficients that are not finite.
    pub fn is_stable(&self) -> bool {
        self.is_within(1.0 + TOLERANCE)
    }

    /// Returns whether all roots have `|z| < radius`, by Jury's table for `z/radius`.
    pub fn is_within(&self, radius: f64) -> bool {
        let mut row = self.0.clone();
        let mut scale = 1.0;
        for part in &mut row {
            *part *= scale;
            scale /= radius;
        }
        while let [first, .., last] = row.as_slice() {
            let ratio = last / first;
            if ratio.is_nan() || ratio.abs() >= 1.0 {
                return false;
            }
            subtract_mirrored(&mut row, ratio);
            row.pop();
        }
        row.iter().all(|part| part.is_finite())
    }

    /// Adds `scale` times `other`.
    #[must_use]
    pub fn plus(&self, other: &Self, scale: f64) -> Self {
        let len = self.0.len().max(other.0.len());
        let mine = self.0.iter().copied().chain(std::iter::repeat(0.0));
        let others = other.0.iter().copied().chain(std::iter::repeat(0.0));
        Self(mine.zip(others).take(len).map(|(mine, other)| mine + scale * other).collect())
    }
}

/// Subtracts `ratio` times the row in reverse.
fn subtract_mirrored(row: &mut [f64], ratio: f64) {
    let is_odd = row.len() % 2 == 1;
    let (front, back) = row.split_at_mut(row.len() / 2);
    if let Some(middle) = back.first_mut().filter(|_| is_odd) {
        *middle -= ratio * *middle;
    }
    for (one, mirrored) in front.iter_mut().zip(back.iter_mut().rev()) {
        (*one, *mirrored) = (*one - ratio * *mirrored, *mirrored - ratio * *one);
    }
}

impl Add for Polynomial {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.plus(&other, 1.0)
    }
}

impl Mul for &Polynomial {
    type Output = Polynomial;

    fn mul(self, other: Self) -> Polynomial {
        let mut product = vec![0.0; (self.0.len() + other.0.len()).saturating_sub(1)];
        for (place, part) in self.0.iter().enumerate() {
            for (sum, factor) in product.iter_mut().skip(place).zip(&other.0) {
                *sum += part * factor;
            }
        }
        Polynomial(product)
    }
}

impl Mul<f64> for Polynomial {
    type Output = Self;

    fn mul(mut self, factor: f64) -> Self {
        self.0.iter_mut().for_each(|part| *part *= factor);
        self
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::ComplexField;
    use proptest::prelude::*;

    use super::*;
    use units::math;

    /// Returns the polynomial with the roots `r` and `m cis(±θ)` in `z`.
    fn with_roots(root: f64, [size, angle]: [f64; 2]) -> Polynomial {
        let pair = Polynomial::new(&[1.0, -2.0 * size * math::cos(angle), size * size]);
        &Polynomial::new(&[1.0, -root]) * &pair
    }

    proptest! {
        #[test]
        fn stable_polynomial_has_its_roots_within_the_circle(
            root in -1.2..1.2_f64, size in 0.0..1.2_f64, angle in 0.0..3.2_f64
        ) {
            let radius = root.abs().max(size);
            prop_assume!((radius - 1.0).abs() > 1e-4);
            prop_assert_eq!(with_roots(root, [size, angle]).is_stable(), radius < 1.0);
        }
    }

    #[test]
    fn free_mass_is_not_unstable() {
        assert!(Polynomial::new(&[1.0, -1.0]).is_stable());
        assert!(!Polynomial::new(&[1.0, -1.001]).is_stable());
    }

    #[test]
    fn invalid_coefficients_are_not_stable() {
        for value in [f64::NAN, f64::INFINITY] {
            assert!(!Polynomial::new(&[1.0, value]).is_stable());
            assert!(!Polynomial::new(&[value]).is_stable());
        }
    }

    #[test]
    fn sum_and_product_agree_with_their_values() {
        let (one, other) = (Polynomial::new(&[1.0, -0.5]), Polynomial::new(&[0.2, 0.1, 0.3]));
        let w = nalgebra::Complex::new(0.3, 0.4);
        let product = (&one * &other).later(2).at(w) - one.at(w) * other.at(w) * w * w;
        let sum = one.plus(&other, 3.0).at(w) - one.at(w) - other.at(w) * 3.0;
        assert!(product.modulus() < 1e-12 && sum.modulus() < 1e-12);
    }
}
