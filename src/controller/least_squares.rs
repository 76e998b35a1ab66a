//! Linear least squares by Householder QR (Golub and Van Loan, 5.3), with what leaving each sample out
//! would change.
//!
//! For a few unknowns whose columns are of like size; nothing of the cycle.

use nalgebra::{DMatrix, DVector};

/// A column is dependent if it is this much smaller than the largest, once the others are taken out of it.
const RANK: f64 = 1e-9;

/// The best solution of `A x = b`.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// The unknowns `x`.
    pub(super) unknowns: DVector<f64>,
    /// `b - A x`, a number per row.
    pub(super) residuals: DVector<f64>,
    /// The same had the row itself been left out: `r / (1 - h)`, where `h` is the row's leverage,
    /// the squared length of its row of Q.
    pub(super) left_out: DVector<f64>,
}

/// Solves `A x = b`; `None` unless the rows determine all unknowns, whichever row is left out.
pub(super) fn solve(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<Solution> {
    if a.nrows() <= a.ncols() {
        return None;
    }
    let qr = a.clone().qr();
    let (q, r) = (qr.q(), qr.r());
    let pivots = r.diagonal().abs();
    if pivots.min().partial_cmp(&(RANK * pivots.max())) != Some(std::cmp::Ordering::Greater) {
        return None;
    }
    let unknowns = r.solve_upper_triangular(&(q.transpose() * b))?;
    let residuals = b - a * &unknowns;
    let free = DVector::from_iterator(q.nrows(), q.row_iter().map(|row| 1.0 - row.norm_squared()));
    if free.min() < RANK {
        return None;
    }
    let left_out = residuals.component_div(&free);
    Some(Solution { unknowns, residuals, left_out })
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
    fn what_the_rows_do_not_determine_is_not_solved() {
        let b = DVector::from_vec(vec![1.0, 2.0, 3.0]);
        assert!(solve(&line(&[1.0, 1.0, 1.0]), &b).is_none());
        assert!(solve(&line(&[1.0, 2.0]), &DVector::zeros(2)).is_none());
        assert!(solve(&line(&[f64::NAN, 2.0, 3.0]), &b).is_none());
        // Without its third row nothing determines the slope.
        assert!(solve(&line(&[1.0, 1.0, 3.0]), &b).is_none());
    }
}
