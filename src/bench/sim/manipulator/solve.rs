//! Simultaneous solution of the laws of all joints for the rates at the end of a step.

use crate::arm::{JointMatrix, Joints};
use crate::manipulator::joint::Law;

/// Change of rate at which the iteration has converged, in rad/s (m/s).
const CONVERGED: f64 = 1e-10;

/// Maximum iterations; two are usual.
const MAX_ITERATIONS: usize = 60;

/// Returns the rates with which `mass` times them equals `momentum` and the impulses of the laws; `guess` is near them.
///
/// Minimises a strictly convex function. Each iteration solves it with the sticking, sliding and limited joints of the
/// previous one, then improves joint after joint, which determines these sets again.
pub(super) fn rates<const N: usize>(
    mass: &JointMatrix<N>,
    momentum: &Joints<N>,
    laws: &[Law; N],
    guess: Joints<N>,
) -> Joints<N> {
    let mut rates = guess;
    for _ in 0..MAX_ITERATIONS {
        if let Some(solved) = linear(mass, momentum, laws, &rates) {
            rates = solved;
        }
        if sweep(mass, momentum, laws, &mut rates) < CONVERGED {
            break;
        }
    }
    rates
}

/// Solves with the state that each joint has at `rates`.
fn linear<const N: usize>(
    mass: &JointMatrix<N>,
    momentum: &Joints<N>,
    laws: &[Law; N],
    rates: &Joints<N>,
) -> Option<Joints<N>> {
    let (mut matrix, mut right) = (*mass, *momentum);
    for ((joint, law), rate) in laws.iter().enumerate().zip(rates.iter()) {
        let mut own = 1.0;
        if let Some([offset, slope]) = law.line(*rate) {
            own = matrix.get((joint, joint))? + slope;
            *right.get_mut(joint)? += offset;
        } else {
            matrix.fill_row(joint, 0.0);
            matrix.fill_column(joint, 0.0);
            *right.get_mut(joint)? = 0.0;
        }
        *matrix.get_mut((joint, joint))? = own;
    }
    matrix.cholesky().map(|matrix| matrix.solve(&right))
}

/// Improves one joint after another; returns the largest change.
fn sweep<const N: usize>(
    mass: &JointMatrix<N>,
    momentum: &Joints<N>,
    laws: &[Law; N],
    rates: &mut Joints<N>,
) -> f64 {
    let mut change = 0.0_f64;
    for ((joint, law), column) in laws.iter().enumerate().zip(mass.column_iter()) {
        let (Some(own), Some(momentum), Some(before)) =
            (column.get(joint), momentum.get(joint), rates.get(joint).copied())
        else {
            continue;
        };
        let others = column.dot(rates) - own * before;
        let rate = law.rate(*own, momentum - others);
        change = change.max((rate - before).abs());
        rates.view_mut((joint, 0), (1, 1)).fill(rate);
    }
    change
}
