//! `[joint.simulated]`: what a simulated motor and gear do that the controller is not told of.

use crate::plant::Drivetrain;
use crate::raw;
use crate::units::Units;
use controller::arm::JointKind;
use controller::calibration::TorqueCurve;

/// The time constant of a current loop, in µs; 1600 µs are 100 Hz.
const CURRENT_LOOP_US: std::ops::RangeInclusive<f64> = 0.0..=10_000.0;

/// The thermal time constant of a winding, in s.
const THERMAL_S: std::ops::RangeInclusive<f64> = 0.1..=36_000.0;

/// The widest gap, in degrees and in m.
const WIDEST: [f64; 2] = [10.0, 0.02];

/// What is given, and what is usual where nothing is; `None` where a key of the other kind of joint stands.
pub(super) fn read(
    given: &raw::Simulated,
    max_torque: f64,
    of: &mut Units<'_, '_, '_>,
) -> Option<Drivetrain> {
    let hysteresis = of
        .at_most_one(("hysteresis_nm", given.hysteresis_nm), ("hysteresis_n", given.hysteresis_n));
    let backlash =
        of.at_most_one(("backlash_deg", given.backlash_deg), ("backlash_m", given.backlash_m));
    let Units { key, kind, problems } = of;
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
    let widest = match kind {
        JointKind::Revolute => degrees,
        JointKind::Prismatic => metres,
    };
    let backlash = problems.within(&key(name), backlash.unwrap_or(0.0), 0.0..=widest);
    Some(Drivetrain {
        current_loop: current_loop_us * 1e-6,
        torque_curve_reverse,
        hysteresis,
        backlash: of.si(backlash),
        thermal_time_constant: thermal_s,
    })
}
