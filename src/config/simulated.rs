//! `[joint.simulated]`: imperfections of a simulated motor and gear, unknown to the controller.

use crate::plant::Drivetrain;
use crate::raw;
use crate::units::Units;
use controller::arm::JointKind;
use controller::calibration::TorqueCurve;
use toml_input::List;

/// Range of the time constant of a current loop, in µs; 1600 µs correspond to 100 Hz.
const CURRENT_LOOP_US: std::ops::RangeInclusive<f64> = 0.0..=10_000.0;

/// Range of the thermal time constant of a winding, in s.
const THERMAL_S: std::ops::RangeInclusive<f64> = 0.1..=36_000.0;

/// Maximum backlash, in degrees and in m.
const MAX_BACKLASH: [f64; 2] = [10.0, 0.02];

/// Reads the imperfections, with defaults for absent keys. Returns `None` after a problem.
pub(super) fn read(
    given: &raw::Simulated,
    max_torque: Option<f64>,
    of: &mut Units<'_, '_>,
) -> Option<Drivetrain> {
    let hysteresis = of.at_most_one(&given.hysteresis_nm, &given.hysteresis_n);
    let stiction = of.at_most_one(&given.stiction_nm, &given.stiction_n);
    let backlash = of.at_most_one(&given.backlash_deg, &given.backlash_m);
    let problems = &mut *of.problems;
    let current_loop_us = problems.within(&given.current_loop_us.or(200.0), CURRENT_LOOP_US);
    let thermal_s = problems.within(&given.thermal_time_constant_s.or(30.0), THERMAL_S);
    let before = problems.count();
    let reverse = given.torque_curve_reverse.get().map(|List(coefficients)| coefficients);
    if let Some((coefficients, max_torque)) = reverse.zip(max_torque) {
        let curve = TorqueCurve::new(coefficients, max_torque);
        problems.take_unless_noted(before, &given.torque_curve_reverse, curve);
    }
    let most = max_torque.map_or(f64::INFINITY, |torque| torque.max(0.0));
    let hysteresis = hysteresis.and_then(|given| problems.within(&given.or(0.0), 0.0..=most));
    let stiction = stiction.and_then(|given| problems.within(&given.or(0.0), 0.0..=most));
    let [degrees, metres] = MAX_BACKLASH;
    let widest = match of.kind {
        JointKind::Revolute => degrees,
        JointKind::Prismatic => metres,
    };
    let backlash = backlash.and_then(|given| problems.within(&given.or(0.0), 0.0..=widest));
    Some(Drivetrain {
        current_loop: current_loop_us? * 1e-6,
        torque_curve_reverse: reverse,
        stiction: stiction?,
        hysteresis: hysteresis?,
        backlash: of.si(backlash?),
        thermal_time_constant: thermal_s?,
    })
}
