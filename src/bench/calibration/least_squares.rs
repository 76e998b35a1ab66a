//! Linear least squares by Householder QR (Golub and Van Loan, 5.3), with leave-one-out residuals and the standard
//! deviations of the unknowns.
//!
//! For a few unknowns with columns of similar size. It allocates, so it is not for the cycle.

use std::cmp::Ordering;

use nalgebra::{DMatrix, DVector};

/// Ratio to the largest column below which the part of a column orthogonal to the others counts as zero.
const RANK: f64 = 1e-9;

/// Least-squares solution of `A x = b`.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// Unknowns `x`.
    pub(super) unknowns: DVector<f64>,
    /// Standard deviation of each unknown, if the residuals are independent noise.
    pub(super) deviations: DVector<f64>,
    /// Residuals `b - A x`, one per row.
    pub(super) residuals: DVector<f64>,
    /// Residual of each row for a fit without it: `r / (1 - h)`. The leverage `h` is the squared length of the row of Q.
    pub(super) left_out: DVector<f64>,
}

/// Solves `A x = b`; `None` unless the rows determine all unknowns without any one of them.
pub(super) fn solve(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<Solution> {
    let (q, r) = factors(a)?;
    let unknowns = r.solve_upper_triangular(&(q.transpose() * b))?;
    let residuals = b - a * &unknowns;
    let free = DVector::from_iterator(q.nrows(), q.row_iter().map(|row| 1.0 - row.norm_squared()));
    if free.min() < RANK {
        return None;
    }
    let left_out = residuals.component_div(&free);
    let inverse = r.solve_upper_triangular(&DMatrix::identity(r.nrows(), r.ncols()))?;
    // The sum of `1 - h` is the number of rows minus that of the unknowns.
    let noise = (residuals.norm_squared() / free.sum()).sqrt();
    let deviations = DVector::from_iterator(r.nrows(), inverse.row_iter().map(|row| row.norm()));
    Some(Solution { unknowns, deviations: deviations * noise, residuals, left_out })
}

/// Solves `A x = b` with a weight per row; `None` unless the rows determine all unknowns.
pub(super) fn weighted(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    weights: &DVector<f64>,
) -> Option<DVector<f64>> {
    let roots = weights.map(f64::sqrt);
    let mut rows = a.clone();
    rows.column_iter_mut().for_each(|mut column| column.component_mul_assign(&roots));
    let (q, r) = factors(&rows)?;
    r.solve_upper_triangular(&(q.transpose() * b.component_mul(&roots)))
}

/// Returns Q and R of `a`; `None` if its columns are dependent or its rows too few.
fn factors(a: &DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    if a.nrows() <= a.ncols() {
        return None;
    }
    let qr = a.clone().qr();
    let (q, r) = (qr.q(), qr.r());
    let pivots = r.diagonal().abs();
    let is_full = pivots.min().partial_cmp(&(RANK * pivots.max())) == Some(Ordering::Greater);
    is_full.then_some((q, r))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(xs: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(xs.len(), 2, |row, column| if column == 0 { 1.0 } else { xs[row] })
    }

    #[test]
    fn the_residual_stands_at_right_angles_on_every_column() {
        let a = line(&[0.0, 1.0, 2.0, 4.0, 7.0]);
        let b = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0, 2.0]);
        let solution = solve(&a, &b).unwrap();
        assert!((a.transpose() * solution.residuals).amax() < 1e-12);
    }

    #[test]
    fn a_row_left_out_is_predicted_by_the_others() {
        let xs = [0.0, 1.0, 2.0, 4.0, 7.0];
        let b = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0, 2.0]);
        let a = line(&xs);
        let solution = solve(&a, &b).unwrap();
        for (row, x) in xs.into_iter().enumerate() {
            let others = solve(&a.clone().remove_row(row), &b.clone().remove_row(row)).unwrap();
            let predicted = others.unknowns[0] + others.unknowns[1] * x;
            assert!((b[row] - predicted - solution.left_out[row]).abs() < 1e-12);
        }
    }

    #[test]
    fn deviations_are_those_of_a_straight_line() {
        let xs = [0.0, 1.0, 2.0, 4.0, 7.0];
        let b = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0, 2.0]);
        let solution = solve(&line(&xs), &b).unwrap();
        // Textbook: s² / Σ (x - mean)² for the slope, and that times the mean of x² for the offset.
        let noise = solution.residuals.norm_squared() / 3.0;
        let spread: f64 = xs.iter().map(|x| (x - 2.8_f64).powi(2)).sum();
        let slope = (noise / spread).sqrt();
        let offset = slope * 14.0_f64.sqrt();
        assert!((solution.deviations[1] - slope).abs() < 1e-12);
        assert!((solution.deviations[0] - offset).abs() < 1e-12);
    }

    #[test]
    fn row_without_weight_does_not_count() {
        let a = line(&[0.0, 1.0, 2.0, 3.0, 4.0]);
        let b = DVector::from_vec(vec![1.0, 3.0, 5.0, 70.0, 9.0]);
        let weights = DVector::from_vec(vec![1.0, 2.0, 1.0, 0.0, 0.5]);
        let unknowns = weighted(&a, &b, &weights).unwrap();
        assert!((unknowns[0] - 1.0).abs() < 1e-12 && (unknowns[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_the_rows_do_not_determine_is_not_solved() {
        let b = DVector::from_vec(vec![1.0, 2.0, 3.0]);
        assert!(solve(&line(&[1.0, 1.0, 1.0]), &b).is_none());
        assert!(solve(&line(&[1.0, 2.0]), &DVector::zeros(2)).is_none());
        assert!(solve(&line(&[f64::NAN, 2.0, 3.0]), &b).is_none());
        // Without its third row nothing determines the slope.
        assert!(solve(&line(&[1.0, 1.0, 3.0]), &b).is_none());
    }
}
