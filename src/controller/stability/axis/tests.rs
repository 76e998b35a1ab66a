use proptest::prelude::*;

use super::*;

/// Returns an axis of a typical hand controller in a typical hand, in contact.
pub(in crate::stability) const AXIS: Axis = Axis {
    name: "x",
    is_rotation: false,
    device: Device {
        mass: 0.6,
        damping: 0.1,
        friction: 0.2,
        full_friction: 0.4,
        compensated_stiffness: 0.0,
        quantum: 1e-5,
    },
    hand: Impedance { stiffness: 500.0, damping: 15.0 },
    environment: Impedance { stiffness: 2_000.0, damping: 20.0 },
    coupling: None,
    yielded_inertia: 0.0,
    tank_damping: 0.0,
    passivity_damping: 0.0,
    gains: AxisGains {
        rate: 2.0,
        pose: 1.0,
        wrench: 0.3,
        damping: 8.0,
        deadband: 0.01,
        plateau: 2.0,
        accommodation: 0.01,
    },
    timing: Timing {
        period: 1e-3,
        torque_delay: 1,
        pose_delay: 3,
        rate_delay: 2,
        accommodation_delay: 0,
        link_cycles: 0,
        is_robot: false,
        servo_lag: 0.01,
        velocity_filter: 0.0,
    },
    is_watched: false,
};

fn axis() -> impl Strategy<Value = Axis> {
    let gains = (0.0..4.0_f64, 0.0..2.0_f64, 0.0..2.0_f64, 0.0..40.0_f64, 0.0..2.0_f64);
    (gains, 1e-3..0.1_f64, 0.0..5.0_f64, 1.0..1e5_f64).prop_map(
        |((rate, pose, wrench, damping, accommodation), deadband, plateau, stiffness)| Axis {
            gains: AxisGains { rate, pose, wrench, damping, deadband, plateau, accommodation },
            environment: Impedance { stiffness, damping: 20.0 },
            ..AXIS
        },
    )
}

fn verdict(axis: &Axis, name: &str) -> Verdict {
    axis.findings().iter().find(|finding| finding.name == name).unwrap().verdict
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn what_holds_has_its_left_side_below_its_right(axis in axis()) {
        for finding in axis.findings() {
            let Finding { left, right, verdict, .. } = &finding;
            prop_assert_eq!(left.value < right.value, *verdict == Verdict::Holds, "{}", finding);
        }
    }

    #[test]
    fn a_hand_that_damps_more_is_refused_no_more(axis in axis(), more in 0.0..50.0_f64) {
        let damping = axis.hand.damping + more;
        let calmer = Axis { hand: Impedance { damping, ..axis.hand }, ..axis };
        for (calmer, finding) in calmer.findings().iter().zip(axis.findings()) {
            prop_assert!(calmer.verdict <= finding.verdict, "{}, {}", calmer, finding);
        }
    }

    #[test]
    fn a_stiffer_surface_is_felt_no_better_in_pose_mode(axis in axis(), by in 1.0..10.0_f64) {
        let stiffness = axis.environment.stiffness * by;
        let harder = Axis { environment: Impedance { stiffness, ..axis.environment }, ..axis };
        let name = "pose reflection";
        prop_assert!(verdict(&harder, name) >= verdict(&axis, name));
    }
}

#[test]
fn where_nothing_is_felt_there_is_nothing_to_say() {
    assert!(Axis { gains: AxisGains::default(), ..AXIS }.findings().is_empty());
}

#[test]
fn without_a_surface_there_is_no_reflection_to_judge() {
    let free = Axis { environment: Impedance::default(), ..AXIS };
    let names: Vec<&str> = free.findings().iter().map(|finding| finding.name).collect();
    assert_eq!(names, ["damping", "return to centre, plateau", "return to centre, slope"]);
}

#[test]
fn return_to_centre_below_friction_is_refused() {
    for (plateau, expected) in
        [(0.2, Verdict::Refuses), (0.3, Verdict::Warns), (0.5, Verdict::Holds)]
    {
        let axis = Axis { gains: AxisGains { plateau, ..AXIS.gains }, ..AXIS };
        assert_eq!(verdict(&axis, "return to centre, plateau"), expected);
    }
}

fn found(axis: &Axis, name: &str) -> Finding {
    axis.findings().into_iter().find(|finding| finding.name == name).unwrap()
}

#[test]
fn virtual_coupling_is_a_spring_and_a_damper_as_felt() {
    let gains = AxisGains { pose: 2.0, ..AXIS.gains };
    // Felt at 0.3 times 2 of itself: K (T/2 + n T) of the spring, B of the damper.
    for (delay, stiffness, damping, required) in
        [(1, 400.0, 0.0, 0.36), (0, 400.0, 4.0, 2.52), (0, 0.0, 4.0, 2.4)]
    {
        let timing = Timing { torque_delay: delay, ..AXIS.timing };
        let coupling = Some(Impedance { stiffness, damping });
        let tied = Axis { coupling, gains, timing, ..AXIS };
        let Side { value, .. } = found(&tied, "virtual coupling").left;
        assert!((value - required).abs() < 1e-6 * required, "{value}");
        let names: Vec<&str> = tied.findings().iter().map(|finding| finding.name).collect();
        assert!(!names.contains(&"pose reflection"), "the surface is not felt");
    }
}

#[test]
fn tank_damper_is_judged_together_with_damping() {
    let tank = |tank_damping| found(&Axis { tank_damping, ..AXIS }, "tank, damper");
    // 2 tan(π/8) M/T = 497.06 N·s/m, of which K_D takes 8.
    let Finding { left, right, verdict, .. } = tank(485.0);
    assert!((left.value - 493.0).abs() < 1e-9 && (right.value - 497.06).abs() < 0.01);
    assert_eq!((verdict, tank(490.0).verdict), (Verdict::Holds, Verdict::Refuses));
    assert!(AXIS.findings().iter().all(|finding| finding.name != "tank, damper"));
}

#[test]
fn quantum_is_borne_by_all_damping_or_by_friction() {
    // Felt: 0.3 times 2,000 N/m. All damping: 0.1 + 8 + 15 N·s/m.
    let Finding { left, right, .. } = found(&AXIS, "pose reflection, quantum");
    assert!((left.value - 600.0).abs() < 1e-9, "{}", left.value);
    assert!((right.value - 2.0 * 0.2 / 1e-5).abs() < 1e-6, "{}", right.value);
    let fine = Axis { device: Device { quantum: 1e-6, ..AXIS.device }, ..AXIS };
    let most = found(&fine, "pose reflection, quantum").right.value;
    assert!((most - 2.0 * 23.1 / 1e-3).abs() < 1e-6, "{most}");
}

#[test]
fn a_warning_says_what_it_is_left_to() {
    let warning = |axis: &Axis| axis.findings().first().map(ToString::to_string).unwrap();
    assert!(warning(&AXIS).ends_with("; left to the hand, b_h = 15.0 N·s/m"));
    let watched = warning(&Axis { is_watched: true, ..AXIS });
    assert!(watched.contains("left to the passivity layer and the hand"), "{watched}");
}
