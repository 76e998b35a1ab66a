//! Selection of the readings that a curve is fitted to.
//!
//! The targets are exact, the readings are not. A first fit is therefore one of readings over targets, where a wrong reading
//! has no leverage. Then the curve is fitted to the inliers, and all readings are compared with it, until none changes.

use nalgebra::{DMatrix, DVector};

use crate::fit::dry::Dry;
use crate::fit::robust::{self, chosen};
use crate::fit::sample::Sample;
use crate::fit::uneven::Sides;

/// Powers of the target in the first fit, enough for the inverse of a curve and for sides that differ.
const POWERS: i32 = 8;
/// Maximum number of comparisons of all readings with the curve of the kept ones.
const ROUNDS: u32 = 12;
/// Resolution of the readings in the first fit, relative to the largest reading: smaller errors do not bend the curve.
const FORGIVEN: f64 = 0.02;
/// Resolution of a target (6071h), in ‰.
const RESOLUTION: f64 = 1.0;
/// Minimum slope for the conversion of distances from ‰ to N·m, relative to the mean slope of the curve.
const FLATTEST: f64 = 0.2;

/// Fitted curve, and the readings that it is fitted to.
pub(super) struct Selection {
    pub(super) dry: Dry,
    /// Flag per reading, set if the fit includes it.
    pub(super) is_kept: Vec<bool>,
}

/// Fits curve and friction to all readings except outliers; `None` if they do not determine both.
pub(super) fn select(samples: &[Sample]) -> Option<Selection> {
    let everything = vec![true; samples.len()];
    let first = first_look(samples).unwrap_or_else(|| everything.clone());
    settle(samples, first).or_else(|| settle(samples, everything))
}

/// Alternates between a fit to the kept readings and a comparison of all readings, until the kept ones do not change.
fn settle(samples: &[Sample], first: Vec<bool>) -> Option<Selection> {
    let mut is_kept = first;
    let mut rounds = 0;
    loop {
        let kept = chosen(samples, &is_kept);
        let dry = Dry::fit(&kept)?;
        // A difference between the sides of zero must not count as outliers.
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

/// Returns a flag per reading, set for those near a smooth curve over the targets.
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
    // With equal steps from end to end, the median of the absolute readings is half of the largest.
    let reach = 2.0 * robust::median(samples.iter().map(|sample| sample.torque.abs()));
    Some(robust::inliers(distances.as_slice(), FORGIVEN * reach))
}
