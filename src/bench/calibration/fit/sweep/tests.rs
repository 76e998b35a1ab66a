//! Tests of fit and doubts together.

use proptest::prelude::*;

use super::*;
use crate::fit::sample::{Direction, Outlier};

const STEP: f64 = 1e-3;

/// Returns ten readings at each of five speeds in both directions; `noise` is added.
fn sweep(law: impl Fn(f64) -> f64, mut noise: impl FnMut() -> f64) -> Vec<Moving> {
    let speeds = [0.1, 0.2, 0.4, 0.7, 1.0];
    let both = speeds.into_iter().flat_map(|speed| [[speed; 10], [-speed; 10]]).flatten();
    both.map(|velocity| Moving { velocity, torque: law(velocity) + noise() }).collect()
}

fn shipped(velocity: f64) -> f64 {
    0.06 * velocity.signum() + 0.024 * velocity
}

#[test]
fn friction_of_a_sweep_is_found_in_both_directions() {
    let found = JointFriction::fit(&sweep(shipped, || 0.0), STEP, true).unwrap();
    for law in [found.up, found.down, found.both] {
        assert!((law.coulomb.value - 0.06).abs() < 1e-12, "{law:?}");
        assert!((law.viscous.value - 0.024).abs() < 1e-12, "{law:?}");
    }
    assert!(found.load.value.abs() < 1e-12 && (found.fastest - 1.0).abs() < 1e-12);
    assert_eq!((found.outliers.len(), found.doubts()), (0, Vec::new()));
}

#[test]
fn directions_may_differ_if_gravity_is_known() {
    let uneven = |v: f64| if v > 0.0 { 0.08 + 0.02 * v } else { -0.05 + 0.03 * v };
    let known = JointFriction::fit(&sweep(uneven, || 0.0), STEP, true).unwrap();
    assert!((known.up.coulomb.value - 0.08).abs() < 1e-12);
    assert!((known.down.coulomb.value - 0.05).abs() < 1e-12);
    assert!((known.both.coulomb.value - 0.065).abs() < 1e-9, "{known:?}");
    let unknown = JointFriction::fit(&sweep(|v| shipped(v) + 0.4, || 0.0), STEP, false).unwrap();
    assert!((unknown.load.value - 0.4).abs() < 1e-12);
    assert!((unknown.up.coulomb.value - 0.06).abs() < 1e-12);
}

#[test]
fn outliers_are_left_out_and_too_many_rejected() {
    let mut readings = sweep(shipped, || 0.0);
    readings[17].torque += 0.5;
    let found = JointFriction::fit(&readings, STEP, true).unwrap();
    let [Outlier { place: 17, distance }] = found.outliers[..] else { panic!("{found:?}") };
    assert!((distance - 0.5).abs() < 1e-6 && found.doubts().is_empty());
    assert!((found.both.coulomb.value - 0.06).abs() < 1e-12);
    for place in [3, 55, 70] {
        readings[place].torque -= 0.3;
    }
    let found = JointFriction::fit(&readings, STEP, true).unwrap();
    assert_eq!(found.doubts(), [FrictionDoubt::Outliers { found: 4, of: 100 }]);
}

#[test]
fn friction_that_brakes_nothing_or_falls_is_doubted() {
    let doubts = |law: &dyn Fn(f64) -> f64| {
        JointFriction::fit(&sweep(law, || 0.0), STEP, true).unwrap().doubts()
    };
    let [FrictionDoubt::Negative { coulomb }] = doubts(&|v| -shipped(v))[..] else { panic!() };
    assert!((coulomb + 0.06).abs() < 1e-12);
    let falling = doubts(&|v| 0.06 * v.signum() - 0.01 * v);
    assert!(matches!(falling[0], FrictionDoubt::Falling { direction: Some(Direction::Up), .. }));
    assert!(falling[0].reason("N·m", "N·m·s/rad").contains("friction up falls with speed"));
    for way in [Direction::Up, Direction::Down] {
        // Friction falls in one direction, but not in both together.
        let one_way =
            |v: f64| 0.06 * v.signum() + if v * way.sign() > 0.0 { -0.01 * v } else { 0.03 * v };
        let [FrictionDoubt::Falling { direction, viscous }] = doubts(&one_way)[..] else {
            panic!("{way}")
        };
        assert_eq!(direction, Some(way));
        assert!((viscous.value + 0.01).abs() < 1e-9, "{viscous:?}");
    }
    // Zero viscous friction is not falling friction.
    assert_eq!(doubts(&|v| 0.06 * v.signum()), []);
}

#[test]
fn noise_as_large_as_friction_is_uncertain() {
    let mut sign = 0_u32;
    let noise = || {
        sign += 1;
        if sign.is_multiple_of(2) { 0.1 } else { -0.1 }
    };
    let found = JointFriction::fit(&sweep(shipped, noise), STEP, true).unwrap();
    let [FrictionDoubt::Uncertain { share }] = found.doubts()[..] else { panic!("{found:?}") };
    assert!((0.3..2.0).contains(&share), "{share}");
}

#[test]
fn too_little_is_refused_and_what_is_missing_is_named() {
    let refused = |keep: &dyn Fn(&Moving) -> bool| {
        let readings: Vec<Moving> = sweep(shipped, || 0.0).into_iter().filter(keep).collect();
        JointFriction::fit(&readings, STEP, true).unwrap_err()
    };
    let (up, down) = (Direction::Up, Direction::Down);
    assert_eq!(refused(&|_| false), NoFriction::DirectionMissing(up));
    assert_eq!(refused(&|r| r.velocity > 0.0), NoFriction::DirectionMissing(down));
    let slow = refused(&|r| r.velocity > 0.0 || r.velocity > -0.3);
    assert_eq!(slow, NoFriction::TooFewSpeeds { direction: down, found: 2 });
    let mut left = 5;
    let few: Vec<Moving> = sweep(shipped, || 0.0)
        .into_iter()
        .filter(|r| {
            r.velocity < 0.0 || {
                left -= 1;
                left >= 0
            }
        })
        .collect();
    let few = JointFriction::fit(&few, STEP, true).unwrap_err();
    assert_eq!(few, NoFriction::TooFew { direction: up, found: 5 });
}

#[test]
fn direction_with_too_few_readings_but_outliers_is_named() {
    for way in [Direction::Up, Direction::Down] {
        let is_driven = |reading: &Moving| reading.velocity * way.sign() > 0.0;
        let few = |count: usize| -> Vec<Moving> {
            // One reading of each speed first, then a second one of each.
            let all = sweep(shipped, || 0.0);
            let places = (0..count).map(|place| place % 5 * 20 + place / 5);
            let driven: Vec<_> = all.iter().copied().filter(is_driven).collect();
            let chosen = places.map(|place| driven[place % 20 + place / 20 * 10]);
            chosen.chain(all.iter().copied().filter(|reading| !is_driven(reading))).collect()
        };
        assert!(JointFriction::fit(&few(6), STEP, true).is_ok());
        let mut readings = few(6);
        readings[2].torque += 0.5;
        let refused = JointFriction::fit(&readings, STEP, true).unwrap_err();
        assert_eq!(refused, NoFriction::TooFew { direction: way, found: 5 });
    }
}

proptest! {
    #[test]
    fn each_direction_of_a_sweep_has_its_own_friction(
        up in prop::array::uniform2(0.01..1.0_f64), down in prop::array::uniform2(0.01..1.0_f64)
    ) {
        let law = |[coulomb, viscous]: [f64; 2], speed: f64| coulomb + viscous * speed;
        let uneven = |v: f64| if v > 0.0 { law(up, v) } else { -law(down, -v) };
        let found = JointFriction::fit(&sweep(uneven, || 0.0), STEP, true).unwrap();
        let mirrored = JointFriction::fit(&sweep(|v| -uneven(-v), || 0.0), STEP, true).unwrap();
        let ways = [(found.up, up), (found.down, down), (mirrored.up, down), (mirrored.down, up)];
        for (found, [coulomb, viscous]) in ways {
            prop_assert!((found.coulomb.value - coulomb).abs() < 1e-9, "{found:?}");
            prop_assert!((found.viscous.value - viscous).abs() < 1e-9, "{found:?}");
            prop_assert!(found.readings == 50 && found.rms < 1e-9, "{found:?}");
        }
        // Both directions have the same speeds.
        for (both, up, down) in [
            (found.both.coulomb, found.up.coulomb, found.down.coulomb),
            (found.both.viscous, found.up.viscous, found.down.viscous),
        ] {
            prop_assert!((both.value - f64::midpoint(up.value, down.value)).abs() < 1e-9);
        }
        prop_assert!((found.load.value + mirrored.load.value).abs() < 1e-9);
    }

    #[test]
    fn any_readings_give_friction_or_a_reason(
        numbers in prop::collection::vec((-2.0..2.0_f64, -9.0..9.0_f64), 0..40)
    ) {
        let readings: Vec<Moving> =
            numbers.into_iter().map(|(velocity, torque)| Moving { velocity, torque }).collect();
        if let Ok(found) = JointFriction::fit(&readings, STEP, true) {
            prop_assert!(found.both.coulomb.value.is_finite() && found.both.rms.is_finite());
        }
    }
}
