//! `[joint.simulated]`: what a simulated motor and gear do that the controller is not told of.

use crate::raw;
use crate::units::Units;
use controller::calibration::TorqueCurve;

/// The time constant of a current loop, in µs; 1600 µs are 100 Hz.
const CURRENT_LOOP_US: std::ops::RangeInclusive<f64> = 0.0..=10_000.0;

/// The thermal time constant of a winding, in s.
const THERMAL_S: std::ops::RangeInclusive<f64> = 0.1..=36_000.0;

/// The widest gap, in degrees and in m.
const WIDEST: [f64; 2] = [10.0, 0.02];

/// What the simulation needs besides what the controller knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulated {
    /// Time constant of the current loop, in s.
    pub current_loop: f64,
    /// c1, c3, c5 of the torque curve where the joint's torque is negative, if they are others there.
    pub torque_curve_reverse: Option<[f64; 3]>,
    /// Width of the hysteresis of its torque, in N·m or N.
    pub hysteresis: f64,
    /// Width of the gap between motor and joint, in rad or m.
    pub backlash: f64,
    /// Thermal time constant of the motor's winding, in s.
    pub thermal_time_constant: f64,
}

/// What is given, and what is usual where nothing is; `None` where a key of the other kind of joint stands.
pub(super) fn read(
    given: &raw::Simulated,
    max_torque: f64,
    of: &mut Units<'_, '_, '_>,
) -> Option<Simulated> {
    let hysteresis = of
        .at_most_one(("hysteresis_nm", given.hysteresis_nm), ("hysteresis_n", given.hysteresis_n));
    let backlash =
        of.at_most_one(("backlash_deg", given.backlash_deg), ("backlash_m", given.backlash_m));
    let Units { key, slides, problems } = of;
    let current_loop_us = given.current_loop_us.unwrap_or(200.0);
    let current_loop_us =
        problems.within(&key("current_loop_us"), current_loop_us, CURRENT_LOOP_US);
    let thermal_s = given.thermal_time_constant_s.unwrap_or(30.0);
    let thermal_s = problems.within(&key("thermal_time_constant_s"), thermal_s, THERMAL_S);
    let before = problems.count();
    let torque_curve_reverse =
        given.torque_curve_reverse.map(|list| list.0).inspect(|coefficients| {
            let curve = TorqueCurve::new(*coefficients, max_torque);
            problems.take_unless_noted(before, &key("torque_curve_reverse"), curve);
        });
    let (name, hysteresis) = hysteresis?;
    let hysteresis =
        problems.within(&key(name), hysteresis.unwrap_or(0.0), 0.0..=max_torque.max(0.0));
    let (name, backlash) = backlash?;
    let [degrees, metres] = WIDEST;
    let backlash = problems.within(
        &key(name),
        backlash.unwrap_or(0.0),
        0.0..=if *slides { metres } else { degrees },
    );
    Some(Simulated {
        current_loop: current_loop_us * 1e-6,
        torque_curve_reverse,
        hysteresis,
        backlash: if *slides { backlash } else { backlash.to_radians() },
        thermal_time_constant: thermal_s,
    })
}
