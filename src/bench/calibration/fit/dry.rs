//! Simultaneous fit of torque curve and dry friction: `per_mille = p(t + s f)`. The curve `p` is odd, `f` is the
//! friction, and `s` is +1 for samples driven up, -1 for those driven down.
//!
//! The load cell reads the motor's torque minus the friction against the driving direction, so the motor's torque is
//! `t + s f`. For a given `f` the problem is linear. So a search over `f` has linear least squares inside (variable
//! projection; Golub and Pereyra 1973), and Gauss-Newton steps follow to full precision.

use nalgebra::DVector;

use crate::fit::polynomial::{ODD, Polynomial, Residuals, columns, unscaled};
use crate::fit::sample::Sample;
use crate::least_squares::{self, Solution};

/// Largest friction of the search, relative to the largest torque.
const REACH: f64 = 0.5;
/// Number of initial values of the search on each side of zero.
const PLACES: u16 = 40;
/// Steps of the golden-section search; each leaves 62 % of the interval.
const SECTIONS: u32 = 40;
/// Gauss-Newton steps; each doubles the correct digits.
const STEPS: u32 = 12;

/// Torque curve with dry friction, which separates the driving directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dry {
    /// Curve over the motor's torque at the joint.
    pub(super) polynomial: Polynomial<3>,
    /// Friction in N·m; negative if samples driven up lie below those driven down.
    pub(super) friction: f64,
    /// Standard deviation of the friction, in N·m.
    pub(super) deviation: f64,
}

impl Dry {
    /// Fits curve and friction; `None` unless the samples determine both without any one of them.
    pub(super) fn fit(samples: &[Sample]) -> Option<Self> {
        let problem = Problem::new(samples);
        let mut friction = problem.search()?;
        let mut best = problem.step(friction)?;
        for _ in 0..STEPS {
            let Some(next) = problem.step(friction + best.change) else { break };
            if next.curve.squares >= best.curve.squares {
                break;
            }
            friction += best.change;
            best = next;
        }
        let residuals = Residuals::from_solution(&best.solution);
        let polynomial = Polynomial::found(best.curve.coefficients(problem.scale), residuals);
        Some(Self { polynomial, friction, deviation: best.deviation })
    }

    /// Fits a curve without friction; `None` unless the samples determine it.
    pub(super) fn without_friction(self, samples: &[Sample]) -> Option<Self> {
        let polynomial = Polynomial::fit(samples, ODD)?;
        Some(Self { polynomial, friction: 0.0, ..self })
    }

    /// Returns the sample at the motor's torque, as if without friction.
    pub(super) fn at_motor(&self, sample: &Sample) -> Sample {
        shifted(sample, self.friction)
    }
}

/// Returns the sample at the motor's torque, which overcomes `friction`, in N·m.
pub(super) fn shifted(sample: &Sample, friction: f64) -> Sample {
    Sample { torque: sample.torque + sample.direction.sign() * friction, ..*sample }
}

/// Samples with their largest torque, the scale of the fit.
struct Problem<'s> {
    samples: &'s [Sample],
    targets: DVector<f64>,
    scale: f64,
}

/// Least-squares curve for a given friction.
struct Curve {
    /// Coefficients of the scaled torques, in ‰.
    scaled: DVector<f64>,
    /// Sum of the squared residuals, in ‰².
    squares: f64,
    residuals: DVector<f64>,
}

/// Gauss-Newton step of the friction, from a curve.
struct Step {
    curve: Curve,
    /// Change of the friction, in N·m.
    change: f64,
    /// Standard deviation of the friction, in N·m.
    deviation: f64,
    /// Solution of the linearized problem: its residuals and leverages count friction as unknown.
    solution: Solution,
}

impl<'s> Problem<'s> {
    fn new(samples: &'s [Sample]) -> Self {
        let scale = samples.iter().map(|sample| sample.torque.abs()).fold(0.0, f64::max);
        let targets = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.per_mille));
        Self { samples, targets, scale }
    }

    /// Returns the friction with the smallest sum of squares, in N·m.
    fn search(&self) -> Option<f64> {
        let place = REACH * self.scale / f64::from(PLACES);
        let sides = (0..=PLACES).flat_map(|place| [f64::from(place), -f64::from(place)]);
        let squares = |friction: f64| self.curve(friction).map(|curve| curve.squares);
        let tried = sides.filter_map(|n| Some((n * place, squares(n * place)?)));
        let (best, _) = tried.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
        let (mut low, mut high) = (best - place, best + place);
        for _ in 0..SECTIONS {
            let [left, right] = [high - golden * (high - low), low + golden * (high - low)];
            if squares(left)? < squares(right)? {
                high = right;
            } else {
                low = left;
            }
        }
        Some(f64::midpoint(low, high))
    }

    /// Returns motor torques divided by the scale.
    fn scaled(&self, friction: f64) -> impl ExactSizeIterator<Item = f64> {
        self.samples.iter().map(move |sample| shifted(sample, friction).torque / self.scale)
    }

    /// Returns the best curve for this friction.
    fn curve(&self, friction: f64) -> Option<Curve> {
        let a = columns(self.scaled(friction), ODD);
        let Solution { unknowns: scaled, residuals, .. } = least_squares::solve(&a, &self.targets)?;
        Some(Curve { scaled, squares: residuals.norm_squared(), residuals })
    }

    /// Linearizes the problem about the best curve for this friction.
    fn step(&self, friction: f64) -> Option<Step> {
        let curve = self.curve(friction)?;
        let slopes = self.scaled(friction).zip(self.samples).map(|(torque, sample)| {
            let powers = ODD.into_iter().zip(curve.scaled.iter());
            let terms = powers.map(|(n, c)| f64::from(n) * c * torque.powi(i32::from(n) - 1));
            sample.direction.sign() * terms.sum::<f64>()
        });
        let slopes = DVector::from_iterator(self.samples.len(), slopes);
        let size = slopes.amax();
        let mut a = columns(self.scaled(friction), ODD).insert_column(ODD.len(), 0.0);
        a.set_column(ODD.len(), &(slopes / size));
        let solution = least_squares::solve(&a, &curve.residuals)?;
        let at_torque = |last: f64| last / size * self.scale;
        let change = at_torque(*solution.unknowns.iter().next_back()?);
        let deviation = at_torque(*solution.deviations.iter().next_back()?);
        Some(Step { curve, change, deviation, solution })
    }
}

impl Curve {
    fn coefficients(&self, scale: f64) -> [f64; 3] {
        unscaled(self.scaled.iter(), scale, ODD)
    }
}
