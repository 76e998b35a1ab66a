//! The experiments of the paper's figures, in short: Fig. 4 at the hand, and what section 4.2 says of torque curves.

use crate::common::prelude::*;
use controller::Settings;
use experiments::fidelity::trial::Arm;
use experiments::return_to_centre::script::Sweep;
use experiments::return_to_centre::trial::SweepResult;
use experiments::torque_curves::calibration::JointCurves;
use experiments::torque_curves::test_force::{Curve, TestForceResult};

const LEG_S: f64 = 4.0;

#[test]
fn return_to_centre_is_felt_as_the_law_says() {
    for (name, axis) in [(KRAFT, 1), (JPL, 5)] {
        let config = config(name);
        let row = SweepResult::play(name, &config, &Sweep::new(&config, axis, LEG_S), 1).unwrap();
        let (figures, law) = (row.figures.unwrap(), row.law);
        assert_eq!((row.stopped_by, row.limited_cycles), (None, 0), "{name}");
        assert!((figures.commanded / law.plateau - 1.0).abs() < 0.01, "{name}: {figures:?}");
        assert!((figures.felt / law.plateau - 1.0).abs() < 0.03, "{name}: {figures:?}");
        assert!((figures.edge.unwrap() / law.deadband - 1.0).abs() < 0.03, "{name}: {figures:?}");
        assert!(figures.hysteresis > figures.damping, "friction is felt, too: {name}: {figures:?}");
        assert!(row.command_from.unwrap() >= law.deadband, "{name}");
        assert!(row.returned.after_s.unwrap() < 1.0, "{name}: {:?}", row.returned);
    }
}

#[test]
fn wall_of_the_channels_is_felt_with_its_stiffness() {
    let config = config(JPL);
    let controller = config.controller;
    let wall = [0.03, 0.03, 0.03, 0.2, 0.2, 0.2];
    let stiffness = [300.0, 300.0, 300.0, 1.0, 1.0, 1.0];
    let channels = controller.channels.with_wall(wall, stiffness).unwrap();
    let walled = config.with_controller(Settings { channels, ..controller });
    let row = SweepResult::play("walled", &walled, &Sweep::new(&walled, 0, LEG_S), 1).unwrap();
    let figures = row.figures.unwrap();
    assert!((figures.wall_stiffness.unwrap() / 300.0 - 1.0).abs() < 0.1, "{figures:?}");
    assert!((figures.edge.unwrap() / 0.01 - 1.0).abs() < 0.05, "{figures:?}");
}

#[test]
fn test_forces_are_right_with_polynomials_alone() {
    let config = config(KRAFT);
    let joint_curves = JointCurves::measure_all(&config, 1).unwrap();
    let felt = |curve| {
        let run = (Arm::Frictionless, curve, 1);
        let row = TestForceResult::play("kraft_like", &config, &joint_curves, run).unwrap();
        let errors = row.felt.map(|feeling| feeling.unwrap().error_percent);
        (errors.into_iter().fold(0.0, f64::max), row.weight_n.unwrap())
    };
    let (line, polynomial) = (felt(Curve::MakersLine), felt(Curve::Polynomial));
    assert!(line.0 > 10.0 && line.1 > 1.0, "{line:?}");
    assert!(polynomial.0 < 1.0 && polynomial.1 < 0.1, "{polynomial:?}");
}
