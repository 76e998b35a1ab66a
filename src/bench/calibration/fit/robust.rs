//! Outliers among readings: a wrong entry, a lever that slipped, a spike of the load cell.
//!
//! A reading is an outlier if its distance from the fit exceeds five times the median absolute deviation (MAD) of all
//! readings (Rousseeuw and Croux 1993). That is 3.4 standard deviations of normal noise. Least squares would follow
//! outliers, so the fit that finds them minimizes absolute deviations. It tolerates a third of wrong readings.

use nalgebra::{DMatrix, DVector};

use crate::least_squares;

/// Median absolute deviations beyond which a reading is an outlier.
const DEVIATIONS: f64 = 5.0;
/// Steps of iteratively reweighted least squares.
const STEPS: u32 = 40;
/// Smallest residual in a weight, relative to the median of the residuals.
const SMALLEST: f64 = 1e-3;

/// Returns the `x` that minimizes the sum of absolute residuals of `A x = b`; `None` if the rows do not determine it.
pub(super) fn least_absolute(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<DVector<f64>> {
    let mut weights = DVector::from_element(b.len(), 1.0);
    let mut unknowns = least_squares::weighted(a, b, &weights)?;
    for _ in 0..STEPS {
        let residuals = (b - a * &unknowns).abs();
        let least = SMALLEST * median(residuals.iter().copied());
        if least <= f64::MIN_POSITIVE {
            break; // more than half of the readings are exact
        }
        weights = residuals.map(|residual| least / residual.max(least));
        let Some(next) = least_squares::weighted(a, b, &weights) else { break };
        unknowns = next;
    }
    Some(unknowns)
}

/// Returns a flag per distance, set for inliers. The median absolute deviation is at least half a step of `resolution`.
pub(super) fn inliers(distances: &[f64], resolution: f64) -> Vec<bool> {
    let mad = median(distances.iter().map(|distance| distance.abs()));
    let limit = DEVIATIONS * mad.max(resolution / 2.0);
    distances.iter().map(|distance| distance.abs() <= limit).collect()
}

/// Returns the entries whose flag is set.
pub(super) fn chosen<T: Copy>(entries: &[T], flags: &[bool]) -> Vec<T> {
    let chosen = entries.iter().zip(flags).filter(|(_, is_chosen)| **is_chosen);
    chosen.map(|(entry, _)| *entry).collect()
}

/// Returns the median; zero without numbers.
pub(super) fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    let [below, above] = [sorted.len().saturating_sub(1) / 2, sorted.len() / 2];
    sorted.get(below).zip(sorted.get(above)).map_or(0.0, |(a, b)| f64::midpoint(*a, *b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_is_the_middle_or_between_the_two() {
        assert!((median([3.0, 1.0, 9.0].into_iter()) - 3.0).abs() < 1e-12);
        assert!((median([3.0, 1.0, 9.0, 5.0].into_iter()) - 4.0).abs() < 1e-12);
        assert!(median(std::iter::empty()).abs() < 1e-12);
    }

    #[test]
    fn third_of_wrong_readings_does_not_move_the_fit() {
        let xs: Vec<f64> = (0..30_u32).map(f64::from).collect();
        let a = DMatrix::from_fn(30, 2, |row, column| [1.0, xs[row]][column]);
        let wrong = |row: usize| match row % 6 {
            0 | 3 => 50.0,
            1 | 5 => 0.01,
            _ => 0.0,
        };
        let b = DVector::from_fn(30, |row, _| 2.0 + 0.5 * xs[row] + wrong(row));
        let unknowns = least_absolute(&a, &b).unwrap();
        assert!((unknowns[1] - 0.5).abs() < 2e-3 && (unknowns[0] - 2.0).abs() < 0.02, "{unknowns}");
        let distances: Vec<f64> = (b - a * unknowns).iter().copied().collect();
        let kept = inliers(&distances, 0.02);
        assert!(kept.iter().enumerate().all(|(row, is_kept)| *is_kept != row.is_multiple_of(3)));
    }
}
