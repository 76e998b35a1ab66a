//! Selection of the readings that a curve is fitted to.
//!
//! The targets are known exactly, the readings are not. So the first look fits readings over targets, where a
//! wrong reading cannot lie beyond all others and draw the curve to itself; then the curve is fitted to what is
//! left, and every reading is compared with it again until none changes sides.

use nalgebra::{DMatrix, DVector};

use crate::fit::dry::Dry;
use crate::fit::robust::{self, chosen};
use crate::fit::sample::Sample;
use crate::fit::uneven::Sides;

/// Powers of the target in the first look: a curve, its inverse, and sides that differ.
const POWERS: i32 = 8;
/// Comparisons of all readings with the curve of the kept ones.
const ROUNDS: u32 = 12;
/// Deviation that the first look forgives, relative to the largest reading: so near, none draws the curve to itself.
const FORGIVEN: f64 = 0.02;
/// Resolution of a target in ‰: it is a whole number.
const RESOLUTION: f64 = 1.0;
/// Smallest slope that turns a distance in ‰ into one in N·m, relative to that of the whole curve.
const FLATTEST: f64 = 0.2;

/// Readings that the curve is fitted to, and the curve.
pub(super) struct Selection {
    pub(super) dry: Dry,
    /// A flag per reading.
    pub(super) is_kept: Vec<bool>,
}

/// Fits curve and friction to all readings but outliers; `None` if they do not determine them.
pub(super) fn select(samples: &[Sample]) -> Option<Selection> {
    let everything = vec![true; samples.len()];
    let first = first_look(samples).unwrap_or_else(|| everything.clone());
    settle(samples, first).or_else(|| settle(samples, everything))
}

/// Compares all readings with the curve of the kept ones until none changes sides.
fn settle(samples: &[Sample], first: Vec<bool>) -> Option<Selection> {
    let mut is_kept = first;
    let mut rounds = 0;
    loop {
        let kept = chosen(samples, &is_kept);
        let dry = Dry::fit(&kept)?;
        // Sides that differ make no outliers.
        let sides = Sides::fit(&dry, &kept, [true, true]);
        let distances: Vec<f64> =
            samples.iter().map(|sample| sides.distance(sample, FLATTEST)).collect();
        let resolution = RESOLUTION / sides.mean_slope();
        let next = robust::inliers(&distances, resolution);
        rounds += 1;
        if next == is_kept || rounds == ROUNDS {
            return Some(Selection { dry, is_kept });
        }
        is_kept = next;
    }
}

/// Returns which readings lie near a smooth curve over the targets.
fn first_look(samples: &[Sample]) -> Option<Vec<bool>> {
    let largest = samples.iter().map(|sample| sample.per_mille.abs()).fold(0.0, f64::max);
    let rows = samples.iter().flat_map(|sample| {
        let target = sample.per_mille / largest;
        let powers = (0..POWERS).map(move |power| target.powi(power));
        powers.chain(std::iter::once(sample.direction.sign()))
    });
    let columns = usize::try_from(POWERS).ok()?.saturating_add(1);
    let a = DMatrix::from_row_iterator(samples.len(), columns, rows);
    let b = DVector::from_iterator(samples.len(), samples.iter().map(|sample| sample.torque));
    let unknowns = robust::least_absolute(&a, &b)?;
    let distances = b - a * unknowns;
    // Of readings at equal steps from end to end half are within half of the range.
    let reach = 2.0 * robust::median(samples.iter().map(|sample| sample.torque.abs()));
    Some(robust::inliers(distances.as_slice(), FORGIVEN * reach))
}
