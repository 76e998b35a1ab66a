//! Tests of the complete fit.

use proptest::prelude::*;

use super::*;
use controller::torque_curve::{InvalidTorqueCurve, TorqueCurve};

const CURVE: [f64; 3] = [133.144, -0.393_453, 0.019_672_6];
const FRICTION: f64 = 0.06;

fn curve(t: f64) -> f64 {
    let [c1, c3, c5] = CURVE;
    c1 * t + c3 * t.powi(3) + c5 * t.powi(5)
}

/// Returns samples up and down between ±6 N·m in `steps` steps, with friction; `noise` is added to each torque.
fn sweep(steps: u16, friction: f64, mut noise: impl FnMut() -> f64) -> Vec<Sample> {
    let mut samples = Vec::new();
    for (direction, lag) in [(Direction::Up, friction), (Direction::Down, -friction)] {
        for step in 0..=steps {
            let torque = 12.0 * f64::from(step) / f64::from(steps) - 6.0;
            let per_mille = curve(torque + lag);
            samples.push(Sample { torque: torque + noise(), per_mille, direction });
        }
    }
    samples
}

fn exact() -> Vec<Sample> {
    sweep(24, 0.0, || 0.0)
}

#[test]
fn samples_of_a_curve_give_the_curve() {
    let calibrated = CurveFit::fit(&exact()).unwrap();
    for (fitted, coefficient) in calibrated.curve.coefficients().into_iter().zip(CURVE) {
        assert!((fitted / coefficient - 1.0).abs() < 1e-11, "{fitted} for {coefficient}");
    }
    assert!((calibrated.curve.max_torque() - 6.0).abs() < 1e-12);
    assert!(calibrated.both.residuals.largest < 1e-9);
    assert!(calibrated.friction.widest < 1e-9 && calibrated.friction.torque.abs() < 1e-9);
    assert!(!calibrated.is_reversed);
    assert!(calibrated.line.residuals.rms > 5.0);
    let off = TorqueCurve::new([133.144 + 7.0, -0.393_453, 0.019_672_6], 0.51).unwrap();
    // Of the samples at 0 and ±0.5 N·m, two are 3.5 ‰ off.
    let distance = calibrated.distance(&exact(), &off).unwrap();
    assert!((distance - 3.5 * (2.0_f64 / 3.0).sqrt()).abs() < 1e-9);
}

#[test]
fn a_motor_that_turns_against_its_joint_has_the_same_curve() {
    let mut samples = exact();
    for sample in &mut samples {
        sample.per_mille = -sample.per_mille;
    }
    let calibrated = CurveFit::fit(&samples).unwrap();
    assert!(calibrated.is_reversed);
    assert!(calibrated.distance(&samples, &calibrated.curve).unwrap() < 1e-9);
    assert_eq!(calibrated.curve, CurveFit::fit(&exact()).unwrap().curve);
}

#[test]
fn friction_is_taken_out_of_the_curve_exactly() {
    // Hysteresis of 2 to 20 % of the range. Left in, 2 % of it bend the curve by 0.3 % of its end, 7 % by 2.4 %.
    let steep = |t: f64| 100.0 * t + 0.6 * t.powi(5);
    let curves: [fn(f64) -> f64; 2] = [curve, steep];
    for curve in curves {
        for width in [0.02, 1.0 / 15.0, 0.1, 0.2] {
            let friction = width * 6.0 / 2.0;
            let mut samples = sweep(40, friction, || 0.0);
            for sample in &mut samples {
                sample.per_mille = curve(sample.torque + sample.direction.sign() * friction);
            }
            let calibrated = CurveFit::fit(&samples).unwrap();
            let found = calibrated.friction;
            assert!((found.torque - friction).abs() < 1e-9 * friction, "{found:?}");
            assert!((found.hysteresis() - width * 6.0).abs() < 1e-8);
            assert!((found.widest - width * 6.0).abs() < 1e-8, "{found:?}");
            for step in 0..=20 {
                let t = calibrated.curve.max_torque() * f64::from(step) / 20.0;
                let error = (calibrated.both.at(t) - curve(t)).abs() / curve(6.0);
                assert!(error < 1e-9, "width {width}: {error} at {t} N·m");
            }
            assert!(calibrated.outliers.is_empty(), "{calibrated:?}");
            assert_eq!(calibrated.doubts(), []);
        }
    }
}

#[test]
fn distance_of_the_directions_is_looked_at_from_end_to_end() {
    // 100 ‰ per N·m; the directions are 2 (3 + t²/4) ‰ apart, so 24 ‰ at the ends and 6 ‰ in the middle.
    let mut samples = exact();
    for Sample { torque, per_mille, direction } in &mut samples {
        let apart = 3.0 + torque.powi(2) / 4.0;
        *per_mille = 100.0 * *torque + direction.sign() * apart;
    }
    let DryFriction { torque, widest, .. } = CurveFit::fit(&samples).unwrap().friction;
    assert!((widest - 0.24).abs() < 0.01, "{widest}");
    assert!((0.03..0.12).contains(&torque), "{torque}");
}

#[test]
fn weak_joint_is_not_taken_for_a_reversed_one() {
    let mut samples = exact();
    for sample in &mut samples {
        (sample.torque, sample.per_mille) = (sample.torque * 1e-3, sample.torque / 3.0);
    }
    let calibrated = CurveFit::fit(&samples).unwrap();
    assert!(!calibrated.is_reversed);
    assert!(calibrated.distance(&samples, &calibrated.curve).unwrap() < 1e-9);
}

#[test]
fn range_ends_where_one_direction_lacks_a_side() {
    let mut samples = exact();
    samples.retain(|s| s.direction == Direction::Up || s.torque > -4.2);
    assert!((CurveFit::fit(&samples).unwrap().curve.max_torque() - 4.0).abs() < 1e-12);
}

#[test]
fn a_curve_that_does_not_rise_is_refused_and_where_is_said() {
    // Slope 100 (1 - 3 u + 2 u²) with u = t² / 16: zero at √8 N·m, below zero up to 4 N·m.
    let flat = |t: f64| 100.0 * (t - t.powi(3) / 16.0 + 0.4 * t.powi(5) / 256.0);
    let mut samples = sweep(24, 0.0, || 0.0);
    for sample in &mut samples {
        sample.per_mille = flat(sample.torque);
    }
    let error = CurveFit::fit(&samples).unwrap_err();
    let NoTorqueCurve::NoCurve(InvalidTorqueCurve::NotMonotone { torque, .. }) = error else {
        panic!("{error}")
    };
    assert!((torque - 8.0_f64.sqrt()).abs() < 1e-9, "{torque}");
}

#[test]
fn too_little_is_refused_and_what_is_missing_is_said() {
    let refused = |keep: &dyn Fn(&Sample) -> bool| {
        let samples: Vec<Sample> = exact().into_iter().filter(keep).collect();
        CurveFit::fit(&samples).unwrap_err()
    };
    let (up, down) = (Direction::Up, Direction::Down);
    assert_eq!(refused(&|_| false), NoTorqueCurve::DirectionMissing(up));
    assert_eq!(refused(&|s| s.direction == up), NoTorqueCurve::DirectionMissing(down));
    assert_eq!(
        refused(&|s| s.direction == up || s.torque.abs() < 1.6),
        NoTorqueCurve::TooFew { direction: down, found: 7 }
    );
    assert_eq!(refused(&|s| s.torque > 0.2), NoTorqueCurve::OneSided { direction: up });
    let twice = |torque: f64| {
        let sample = Sample { torque, per_mille: curve(torque), direction: up };
        [sample; 4].into_iter().chain([Sample { direction: down, ..sample }; 4])
    };
    let repeated: Vec<Sample> = [-2.0, 2.0].into_iter().flat_map(twice).collect();
    assert_eq!(
        CurveFit::fit(&repeated).unwrap_err(),
        NoTorqueCurve::Undetermined { direction: up }
    );
    let mut broken = exact();
    broken[4].torque = f64::NAN;
    assert_eq!(CurveFit::fit(&broken).unwrap_err(), NoTorqueCurve::NotFinite { place: 5 });
}

proptest! {
    #[test]
    fn noisy_curve_is_recovered_within_twice_the_stated_error(
        noise in prop::collection::vec(-0.03..0.03_f64, 98)
    ) {
        let mut noise = noise.into_iter();
        let samples = sweep(48, FRICTION, || noise.next().unwrap());
        let calibrated = CurveFit::fit(&samples).unwrap();
        for step in 0..=60 {
            let t = f64::from(step) / 10.0 * calibrated.curve.max_torque() / 6.0;
            let error = (calibrated.both.at(t) - curve(t)).abs();
            // Only noise remains; at an end three standard deviations of the curve are twice the noise.
            prop_assert!(error < 2.0 * calibrated.both.residuals.left_out_rms, "{error} at {t}");
        }
    }

    #[test]
    fn any_samples_give_a_curve_or_a_reason(
        c1 in 1.0..200.0_f64, c3 in -6.0..6.0_f64, c5 in -0.1..0.1_f64, is_reversed in any::<bool>()
    ) {
        let at = |t: f64| c1 * t + c3 * t.powi(3) + c5 * t.powi(5);
        let slope = |t: f64| c1 + 3.0 * c3 * t.powi(2) + 5.0 * c5 * t.powi(4);
        let slopes = |end: f64| (0..=600).map(move |step| slope(end * f64::from(step) / 600.0));
        let least = |end: f64| slopes(end).fold(f64::INFINITY, f64::min);
        let is_gentle = least(6.0) > slopes(6.0).fold(0.0, f64::max) / 2.0;
        // Excludes curves whose slope is zero within rounding.
        prop_assume!(least(6.0).abs() > 0.01 * c1);
        let sign = if is_reversed { -1.0 } else { 1.0 };
        let mut samples = sweep(24, 0.0, || 0.0);
        samples.iter_mut().for_each(|sample| sample.per_mille = sign * at(sample.torque));
        match CurveFit::fit(&samples) {
            Ok(calibrated) => {
                // Readings where a curve is too flat may be left out: its range ends before them.
                let end = calibrated.curve.max_torque();
                prop_assert!(least(end) > 0.0, "up to {end} N·m");
                prop_assert!(!is_gentle || end > 6.0 - 1e-9, "up to {end} N·m");
                prop_assert!(calibrated.curve.least_slope().0 > 0.0);
                prop_assert_eq!(calibrated.is_reversed, is_reversed);
                for step in 0..=10_u8 {
                    let t = end * f64::from(step) / 10.0;
                    prop_assert!((calibrated.curve.at(t) - at(t)).abs() < 1e-6 * (1.0 + at(6.0).abs()));
                }
            }
            Err(NoTorqueCurve::NoCurve(InvalidTorqueCurve::NotMonotone { .. })) => {
                prop_assert!(least(6.0) < 0.0, "{}", least(6.0));
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn wild_samples_give_a_curve_that_rises_or_a_reason(
        numbers in prop::collection::vec((any::<f64>(), any::<f64>(), any::<bool>()), 0..40)
    ) {
        let samples: Vec<Sample> = numbers.into_iter().map(|(torque, per_mille, is_up)| Sample {
            torque,
            per_mille,
            direction: if is_up { Direction::Up } else { Direction::Down },
        }).collect();
        let rises = CurveFit::fit(&samples).map(|calibrated| calibrated.curve.least_slope().0 > 0.0);
        prop_assert!(rises != Ok(false));
    }
}

#[test]
fn outlier_is_reported_with_its_distance_and_changes_nothing() {
    let clean = sweep(40, FRICTION, || 0.0);
    for (place, slip) in [(7, 1.5), (30, 3.0), (60, -0.5)] {
        let mut samples = clean.clone();
        samples[place].torque += slip;
        let calibrated = CurveFit::fit(&samples).unwrap();
        let [outlier] = calibrated.outliers[..] else { panic!("{:?}", calibrated.outliers) };
        assert_eq!(outlier.place, place);
        assert!((outlier.distance - slip).abs() < 1e-6, "{outlier:?}");
        for (found, coefficient) in calibrated.both.coefficients.into_iter().zip(CURVE) {
            assert!((found / coefficient - 1.0).abs() < 1e-9);
        }
        assert_eq!(calibrated.doubts(), []);
    }
}
