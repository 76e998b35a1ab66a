//! Difference between the sides of zero: a load cell with an offset, or a joint that is weaker on one side.
//!
//! An odd fit averages the sides and cannot distinguish the two. They differ in shape, so the readings are fitted again with
//! both as unknowns, for the size, and with each alone, for the kind:
//!
//! ```text
//!  per_mille = p(g w + s f),   w = t - δ,   g = 1 - κ sgn(w)      δ: offset of the load cell, κ: sides
//! ```

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::fit::dry::Dry;
use crate::fit::polynomial::{ODD, columns, unscaled};
use crate::fit::sample::Sample;
use crate::least_squares;

/// Number of torques at which the even part is evaluated, from zero to the end.
const PLACES: u16 = 100;
/// Maximum number of Gauss-Newton steps.
const STEPS: u32 = 20;
/// Maximum number of halvings of a step that does not improve the fit.
const HALVINGS: u32 = 6;
/// Number of unknowns common to both kinds: c1, c3, c5 and friction.
const COMMON: usize = ODD.len() + 1;

/// Difference between the two sides of zero torque.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Unevenness {
    /// Largest even part, relative to the end of the curve.
    pub share: f64,
    /// Set if an offset of the load cell fits better than sides of different strength.
    pub is_offset: bool,
    /// Offset of the load cell in N·m, fitted with equal sides.
    pub offset: f64,
    /// Torque of the positive side relative to the negative one at the same target, fitted without an offset.
    pub strength: f64,
}

impl Unevenness {
    /// Compares the sides of samples with the curve `dry`, within ±`range` in N·m.
    pub(super) fn compare(dry: &Dry, samples: &[Sample], range: f64) -> Self {
        let both = Sides::fit(dry, samples, [true, true]);
        let offset = Sides::fit(dry, samples, [true, false]);
        let strength = Sides::fit(dry, samples, [false, true]);
        let even = |place: u16| {
            let torque = range * f64::from(place) / f64::from(PLACES);
            let [up, down] = [torque, -torque].map(|torque| both.curve(both.scaled(torque)));
            f64::midpoint(up, down).abs()
        };
        let largest = (0..=PLACES).map(even).fold(0.0, f64::max);
        Self {
            share: largest / dry.polynomial.at(range).abs(),
            is_offset: offset.squares(samples) <= strength.squares(samples),
            offset: offset.offset,
            strength: (1.0 + strength.side) / (1.0 - strength.side),
        }
    }
}

/// Curve with an offset of the torques and sides of different strength.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sides {
    coefficients: [f64; 3],
    friction: f64,
    /// Offset δ of the load cell, in N·m.
    offset: f64,
    /// Difference κ of the sides, without unit.
    side: f64,
    /// Largest motor torque of the samples, in N·m.
    extent: f64,
}

impl Sides {
    /// Fits the chosen ones of offset and side, starting from `dry`; returns `dry` if the samples do not determine them.
    pub(super) fn fit(dry: &Dry, samples: &[Sample], is_chosen: [bool; 2]) -> Self {
        let motor = samples.iter().map(|sample| dry.at_motor(sample).torque.abs());
        let mut best = Self {
            coefficients: dry.polynomial.coefficients,
            friction: dry.friction,
            offset: 0.0,
            side: 0.0,
            extent: motor.fold(0.0, f64::max),
        };
        let mut squares = best.squares(samples);
        for _ in 0..STEPS {
            let Some(step) = best.step(samples, is_chosen) else { break };
            let parts = (0..HALVINGS).map(|halvings| 0.5_f64.powi(halvings.cast_signed()));
            let tried = parts.map(|part| best.after(&step, part));
            let better = tried.map(|next| (next, next.squares(samples)));
            let Some((next, least)) = better.into_iter().find(|(_, least)| *least < squares) else {
                break;
            };
            (best, squares) = (next, least);
        }
        best
    }

    /// Returns the distance of a reading from the curve in N·m, within the largest motor torque. The slope for the
    /// conversion is at least `flattest` times the mean slope.
    pub(super) fn distance(&self, sample: &Sample, flattest: f64) -> f64 {
        let motor = self.motor(sample);
        let within = motor.clamp(-self.extent, self.extent);
        let slope = self.slope(within).max(flattest * self.mean_slope());
        motor - within - (sample.per_mille - self.curve(within)) / slope
    }

    /// Returns the mean slope, in ‰ per N·m.
    pub(super) fn mean_slope(&self) -> f64 {
        self.curve(self.extent) / self.extent
    }

    /// Returns the motor torque without friction at a reading in N·m.
    fn scaled(&self, torque: f64) -> f64 {
        let load = torque - self.offset;
        load - self.side * load.abs()
    }

    fn motor(&self, sample: &Sample) -> f64 {
        self.scaled(sample.torque) + sample.direction.sign() * self.friction
    }

    fn curve(&self, motor: f64) -> f64 {
        let terms = self.coefficients.iter().zip(ODD);
        terms.map(|(c, n)| c * motor.powi(i32::from(n))).sum()
    }

    fn slope(&self, motor: f64) -> f64 {
        let terms = self.coefficients.iter().zip(ODD);
        terms.map(|(c, n)| c * f64::from(n) * motor.powi(i32::from(n) - 1)).sum()
    }

    fn residual(&self, sample: &Sample) -> f64 {
        sample.per_mille - self.curve(self.motor(sample))
    }

    fn squares(&self, samples: &[Sample]) -> f64 {
        samples.iter().map(|sample| self.residual(sample).powi(2)).sum()
    }

    /// Returns the Gauss-Newton step of c1, c3, c5, friction, offset and side.
    fn step(&self, samples: &[Sample], is_chosen: [bool; 2]) -> Option<[f64; COMMON + 2]> {
        let column = |of: &dyn Fn(&Sample) -> f64| {
            DVector::from_iterator(samples.len(), samples.iter().map(of))
        };
        let slope = |sample: &Sample| self.slope(self.motor(sample));
        let load = |sample: &Sample| sample.torque - self.offset;
        let gain = |sample: &Sample| 1.0 - self.side * load(sample).signum();
        let powers = columns(samples.iter().map(|s| self.motor(s) / self.extent), ODD);
        let mut all: Vec<DVector<f64>> = powers.column_iter().map(|c| c.into_owned()).collect();
        all.push(column(&|sample| sample.direction.sign() * slope(sample)));
        let sides = [
            column(&|sample| -gain(sample) * slope(sample)),
            column(&|sample| -load(sample).abs() * slope(sample)),
        ];
        let chosen = sides.into_iter().zip(is_chosen).filter(|(_, is_chosen)| *is_chosen);
        all.extend(chosen.map(|(column, _)| column));
        let sizes: Vec<f64> = all.iter().map(DVector::amax).collect();
        let scaled = all.iter().zip(&sizes).map(|(column, size)| column / *size);
        let a = DMatrix::from_columns(&scaled.collect::<Vec<_>>());
        let solution = least_squares::solve(&a, &column(&|sample| self.residual(sample)))?;
        let unknowns = solution.unknowns.iter().zip(&sizes).map(|(unknown, size)| unknown / size);
        let mut found: Vec<f64> = unknowns.collect();
        if let [false, true] = is_chosen {
            found.insert(COMMON, 0.0);
        }
        found.resize(COMMON + 2, 0.0);
        found.try_into().ok()
    }

    /// Returns the curve after the fraction `part` of a step.
    fn after(&self, step: &[f64; COMMON + 2], part: f64) -> Self {
        let [c1, c3, c5, friction, offset, side] = step.map(|change| part * change);
        let changes = unscaled([c1, c3, c5].iter(), self.extent, ODD);
        let mut coefficients = self.coefficients;
        for (coefficient, change) in coefficients.iter_mut().zip(changes) {
            *coefficient += change;
        }
        Self {
            coefficients,
            friction: self.friction + friction,
            offset: self.offset + offset,
            side: self.side + side,
            ..*self
        }
    }
}
