//! The torque curve of a joint from measurements (4.2, Fig. 6): an odd polynomial of the fifth order by
//! least squares, and how well it says what was measured.
//!
//! Not the file it comes from. Torques are scaled to ±1 before the fit, so that their fifth powers do
//! not drown the first. Friction makes a joint exert less while the command rises and more while it falls:
//! where both were measured, half the width between them is set aside before the curve is fitted, or the
//! bends of the curve would be smeared by it.

use nalgebra::DMatrix;
use nalgebra::DVector;
use thiserror::Error;

use crate::controller::calibration::InvalidTorqueCurve;
use crate::controller::calibration::TorqueCurve;

/// Fewer samples than these do not show what three coefficients leave over.
const FEWEST: usize = 8;

/// How often friction is set aside and the curve fitted again: each time what is left of it is a small
/// part of what was.
const CENTRINGS: u32 = 5;

/// The part of the range that hysteresis is taken from.
const INNER: f64 = 0.95;

/// A column that the others explain but for this part of it is none.
const DEPENDENT: f64 = 1e-9;

/// One measurement: what the drive was asked for, and what the joint then exerted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// In ‰ of rated torque (6071h).
    pub per_mille: f64,
    /// In N·m, or N of a sliding joint.
    pub torque: f64,
    /// Whether the command was rising when it was taken; friction holds the joint back then.
    pub rising: bool,
}

/// A fitted curve and how well it fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// c1, c3, c5 in ‰ per N·m, N·m³, N·m⁵.
    pub coefficients: [f64; 3],
    /// How many samples it was made of.
    pub samples: usize,
    /// Root mean square of what is left over, in ‰.
    pub residual: f64,
    /// The largest of those, in ‰.
    pub largest_residual: f64,
    /// Root mean square of what each sample would be missed by if it had been left out, in ‰.
    pub leave_one_out: f64,
    /// What the best straight line leaves over, in ‰.
    pub linear_residual: f64,
}

/// All that is known of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFit {
    /// Of all samples together: the curve to use.
    pub both: Fit,
    /// Of the joint driven forwards, and backwards: how symmetric it is.
    pub forwards: Fit,
    /// Likewise.
    pub backwards: Fit,
    /// -1 where positive commands drive the joint backwards: the motor turns against it.
    pub sign: f64,
    /// The curve, proven to rise over the whole range.
    pub curve: TorqueCurve,
    /// Mean torque between rising and falling commands at the same command, in N·m; none where only one
    /// of them was measured.
    pub hysteresis: Option<f64>,
}

/// Why measurements make no curve.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidFit {
    /// Too few.
    #[error("{0} samples are too few; {FEWEST} are needed in each driving direction")]
    TooFew(usize),
    /// A number that is none.
    #[error("sample {0} is not finite")]
    NotFinite(usize),
    /// Three coefficients cannot be told apart.
    #[error("the samples have too few different torques for a curve of the fifth order")]
    Dependent,
    /// The curve that fits is none.
    #[error(transparent)]
    Curve(#[from] InvalidTorqueCurve),
}

/// Fits the samples of one joint.
///
/// # Errors
/// Samples that are too few, not numbers, or whose curve does not rise over the range they cover in both
/// driving directions.
pub fn fit(samples: &[Sample]) -> Result<JointFit, InvalidFit> {
    let is_finite = |sample: &Sample| sample.per_mille.is_finite() && sample.torque.is_finite();
    if let Some(place) = samples.iter().position(|sample| !is_finite(sample)) {
        return Err(InvalidFit::NotFinite(place + 1));
    }
    let sign = samples.iter().map(|sample| sample.per_mille * sample.torque).sum::<f64>().signum();
    let turned: Vec<Sample> =
        samples.iter().map(|s| Sample { per_mille: s.per_mille * sign, ..*s }).collect();
    let (forwards, backwards): (Vec<Sample>, Vec<Sample>) =
        turned.iter().partition(|sample| sample.torque >= 0.0);
    for direction in [&forwards, &backwards] {
        if direction.len() < FEWEST {
            return Err(InvalidFit::TooFew(direction.len()));
        }
    }
    let mut width = None;
    for _ in 0..CENTRINGS {
        let curve = curve(&centred(&turned, width.unwrap_or(0.0)))?;
        width = hysteresis(&turned, &curve);
    }
    let turned = centred(&turned, width.unwrap_or(0.0));
    let (forwards, backwards): (Vec<Sample>, Vec<Sample>) =
        turned.iter().partition(|sample| sample.torque >= 0.0);
    Ok(JointFit {
        both: least_squares(&turned)?,
        forwards: least_squares(&forwards)?,
        backwards: least_squares(&backwards)?,
        sign,
        curve: curve(&turned)?,
        hysteresis: width,
    })
}

/// The curve of all samples, over the range that both driving directions have covered.
fn curve(samples: &[Sample]) -> Result<TorqueCurve, InvalidFit> {
    let (forwards, backwards): (Vec<Sample>, Vec<Sample>) =
        samples.iter().partition(|sample| sample.torque >= 0.0);
    let range = reach(&forwards).min(reach(&backwards));
    Ok(TorqueCurve::new(least_squares(samples)?.coefficients, range)?)
}

/// The samples without friction: rising and falling ones moved together by `width` in all.
fn centred(samples: &[Sample], width: f64) -> Vec<Sample> {
    let moved = |sample: &Sample| {
        let by = if sample.rising { width / 2.0 } else { -width / 2.0 };
        Sample { torque: sample.torque + by, ..*sample }
    };
    samples.iter().map(moved).collect()
}

/// The odd polynomial that leaves the least squares over.
///
/// # Errors
/// Samples that are too few for three coefficients, or too much alike.
pub fn least_squares(samples: &[Sample]) -> Result<Fit, InvalidFit> {
    if samples.len() < FEWEST {
        return Err(InvalidFit::TooFew(samples.len()));
    }
    let scale = reach(samples);
    let u = |row: usize| samples.get(row).map_or(0.0, |sample| sample.torque / scale);
    let powers = [1, 3, 5];
    let columns = DMatrix::from_fn(samples.len(), 3, |row, column| {
        u(row).powi(powers.get(column).copied().unwrap_or(0))
    });
    let asked = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.per_mille));
    let qr = columns.clone().qr();
    let (q, r) = (qr.q(), qr.r());
    if !r.diagonal().iter().all(|entry| entry.abs() > DEPENDENT) {
        return Err(InvalidFit::Dependent);
    }
    let scaled =
        r.solve_upper_triangular(&(q.transpose() * &asked)).ok_or(InvalidFit::Dependent)?;
    let left = &asked - &columns * &scaled;
    let [d1, d3, d5] = [0, 1, 2].map(|place| scaled.get(place).copied().unwrap_or(0.0));

    let line = columns.column(0);
    let slope = line.dot(&asked) / line.norm_squared();
    let straight = &asked - line * slope;
    // Without a sample, it is missed by its residual over one less its leverage.
    let missed = left.iter().zip(q.row_iter()).map(|(left, row)| left / (1.0 - row.norm_squared()));
    Ok(Fit {
        coefficients: [d1 / scale, d3 / scale.powi(3), d5 / scale.powi(5)],
        samples: samples.len(),
        residual: rms(left.iter().copied()),
        largest_residual: left.amax(),
        leave_one_out: rms(missed),
        linear_residual: rms(straight.iter().copied()),
    })
}

/// By how much torque falling and rising commands differ, on average over the range but its ends, where
/// the curve is cut off.
fn hysteresis(samples: &[Sample], curve: &TorqueCurve) -> Option<f64> {
    let end = INNER * curve.at(curve.max_torque());
    let mean = |rising: bool| {
        let off = samples
            .iter()
            .filter(|sample| sample.rising == rising && sample.per_mille.abs() < end)
            .map(|sample| sample.torque - curve.torque(sample.per_mille));
        let (sum, count) = off.fold((0.0, 0.0), |(sum, count), off| (sum + off, count + 1.0));
        (count > 0.0).then(|| sum / count)
    };
    Some((mean(false)? - mean(true)?).max(0.0))
}

/// The largest torque without sign.
fn reach(samples: &[Sample]) -> f64 {
    samples.iter().fold(0.0, |reach: f64, sample| reach.max(sample.torque.abs()))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TRUE: [f64; 3] = [133.0, -0.4, 0.02];

    /// Sweeps up and down over ±`max`, `friction` holding back, each sample off by `noise`.
    fn sweep(
        coefficients: [f64; 3],
        max: f64,
        friction: f64,
        noise: impl Fn(i32) -> f64,
    ) -> Vec<Sample> {
        let [c1, c3, c5] = coefficients;
        let at = |step: i32, rising: bool| {
            let t = max * f64::from(step) / 20.0;
            let per_mille = t * (c1 + t * t * (c3 + t * t * c5));
            let held_back = if rising { -friction } else { friction };
            Sample { per_mille, torque: t + held_back + noise(step), rising }
        };
        (-20..=20)
            .map(|step| at(step, true))
            .chain((-20..=20).map(|step| at(step, false)))
            .collect()
    }

    proptest! {
        #[test]
        fn a_curve_is_found_again(
            c1 in 50.0..300.0_f64, c3 in -0.05..0.5_f64, c5 in 0.0..0.1_f64, sign in any::<bool>()
        ) {
            let sign = if sign { 1.0 } else { -1.0 };
            let samples: Vec<_> = sweep([c1, c3, c5], 6.0, 0.0, |_| 0.0)
                .into_iter()
                .map(|sample| Sample { per_mille: sample.per_mille * sign, ..sample })
                .collect();
            let fit = fit(&samples).unwrap();
            for (found, true_) in fit.both.coefficients.iter().zip([c1, c3, c5]) {
                prop_assert!((found - true_).abs() < 1e-8 * c1, "{found} for {true_}");
            }
            prop_assert!((fit.sign - sign).abs() < 1e-12 && fit.both.residual < 1e-6);
        }

        #[test]
        fn leaving_one_out_is_what_it_says(seed in 0..1_000_i32) {
            let noise = |step: i32| 0.02 * f64::from((step * 37 + seed) % 17 - 8) / 8.0;
            let samples = sweep(TRUE, 6.0, 0.0, noise);
            let fit = least_squares(&samples).unwrap();
            let missed = (0..samples.len()).map(|out| {
                let mut rest = samples.clone();
                let left_out = rest.remove(out);
                let [c1, c3, c5] = least_squares(&rest).unwrap().coefficients;
                let t = left_out.torque;
                left_out.per_mille - t * (c1 + t * t * (c3 + t * t * c5))
            });
            prop_assert!((rms(missed) - fit.leave_one_out).abs() < 1e-6 * fit.leave_one_out);
            prop_assert!(fit.leave_one_out >= fit.residual);
        }
    }

    #[test]
    fn hysteresis_is_twice_the_friction() {
        let fit = fit(&sweep(TRUE, 6.0, 0.1, |_| 0.0)).unwrap();
        assert!((fit.hysteresis.unwrap() - 0.2).abs() < 0.01, "{:?}", fit.hysteresis);
        let rising = |sample: &Sample| sample.rising;
        let once: Vec<_> = sweep(TRUE, 6.0, 0.1, |_| 0.0).into_iter().filter(rising).collect();
        assert_eq!(super::fit(&once).unwrap().hysteresis, None);
    }

    #[test]
    fn a_curve_that_falls_is_rejected_and_says_where() {
        let error = fit(&sweep([100.0, -2.0, 0.0], 6.0, 0.0, |_| 0.0)).unwrap_err();
        let InvalidFit::Curve(InvalidTorqueCurve::NotMonotone { torque, .. }) = error else {
            panic!("{error}");
        };
        assert!((torque - (100.0_f64 / 6.0).sqrt()).abs() < 1e-6);
    }

    #[test]
    fn measurements_that_show_nothing_are_refused() {
        let samples = sweep(TRUE, 6.0, 0.0, |_| 0.0);
        assert_eq!(fit(&samples[..5]).unwrap_err(), InvalidFit::TooFew(0));
        let forwards: Vec<_> = samples.iter().filter(|s| s.torque > 0.0).copied().collect();
        assert_eq!(fit(&forwards).unwrap_err(), InvalidFit::TooFew(0));
        let alike = vec![Sample { per_mille: 100.0, torque: 1.0, rising: true }; 20];
        assert_eq!(least_squares(&alike).unwrap_err(), InvalidFit::Dependent);
        let mut broken = samples;
        broken[7].torque = f64::NAN;
        assert_eq!(fit(&broken).unwrap_err(), InvalidFit::NotFinite(8));
    }
}
