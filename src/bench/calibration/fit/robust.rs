//! Readings that belong to no curve: slips of the pen, a lever that slipped, a spike of the load cell.
//!
//! A reading is an outlier if it lies more than five times the median absolute deviation (MAD) of all from
//! the fit (Rousseeuw and Croux 1993; 3.4 standard deviations of normal noise). Least squares would follow an
//! outlier, so the fit that looks for them minimizes absolute deviations: a third of the readings may be wrong.

use nalgebra::{DMatrix, DVector};

use crate::least_squares;

/// Median absolute deviations beyond which a reading is an outlier.
const DEVIATIONS: f64 = 5.0;
/// Steps of iteratively reweighted least squares.
const STEPS: u32 = 40;
/// Smallest residual that a weight counts, relative to their median.
const SMALLEST: f64 = 1e-3;

/// Returns the solution of `A x = b` with the least sum of absolute residuals; `None` if the rows do not determine it.
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

/// Returns which distances are those of a fit. Numbers in steps of `resolution` have no deviation below half a step.
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

/// Returns the median; zero of nothing.
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
