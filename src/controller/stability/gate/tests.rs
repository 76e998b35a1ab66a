use super::*;
use crate::stability::axis::tests::AXIS;
use crate::stability::axis::{AxisGains, Timing};

/// Returns the findings of the first axis of a grip with 0.6 kg along every axis.
fn findings(axis: Axis) -> Vec<Finding> {
    let postures = [GripDynamics::of_mass(0.6, 0.1)];
    StabilityGate { axes: &[axis; 6], postures: &postures }.findings(0)
}

fn found(axis: Axis, name: &str) -> Finding {
    findings(axis).into_iter().find(|finding| finding.name == name).unwrap()
}

fn with_gains(change: impl Fn(&mut AxisGains)) -> Axis {
    let mut axis = AXIS;
    change(&mut axis.gains);
    axis
}

#[test]
fn damping_is_borne_far_beyond_the_hand() {
    let bound = found(AXIS, "damping, held").right.value;
    // The bare mass is stable up to 2 tan(π/8) M/T = 497 N·s/m.
    assert!((450.0..520.0).contains(&bound), "{bound}");
    for (damping, verdict) in
        [(40.0, Verdict::Holds), (0.9 * bound, Verdict::Warns), (1.05 * bound, Verdict::Refuses)]
    {
        assert_eq!(
            found(with_gains(|gains| gains.damping = damping), "damping, held").verdict,
            verdict
        );
    }
}

#[test]
fn damper_of_the_passivity_layer_is_judged_with_damping() {
    let name = "passivity damper, held";
    let alone = found(AXIS, "damping, held").right.value;
    let with_layer = found(Axis { passivity_damping: 75.0, ..AXIS }, name);
    assert_eq!(with_layer.verdict, Verdict::Holds);
    assert!((with_layer.right.value / (alone - AXIS.gains.damping) - 1.0).abs() < 1e-3);
    let strong = found(Axis { passivity_damping: alone, ..AXIS }, name);
    assert_eq!((strong.verdict, strong.culprit), (Verdict::Warns, Culprit::PassivityDamper));
    let invalid = found(Axis { passivity_damping: f64::NAN, ..AXIS }, name);
    assert_eq!(invalid.verdict, Verdict::Refuses);
    assert!(findings(AXIS).iter().all(|finding| finding.name != name));
}

#[test]
fn refused_surface_names_the_stiffness_that_holds() {
    let stiff = |stiffness| {
        let axis = Axis { environment: Impedance { stiffness, damping: 20.0 }, ..AXIS };
        found(axis, "pose reflection, held")
    };
    for stiffness in [50_000.0, 1e12] {
        let refused = stiff(stiffness).to_string();
        let words = "with these gains a surface holds up to ";
        let (_, named) = refused.split_once(words).unwrap_or_else(|| panic!("{refused}"));
        let named: f64 = named.split_once(" N/m").unwrap().0.parse().unwrap();
        assert_eq!(stiff(0.95 * named).verdict, Verdict::Warns, "{stiffness}: {named}");
        assert_eq!(stiff(1.05 * named).verdict, Verdict::Refuses, "{stiffness}: {named}");
    }
}

#[test]
fn grip_let_go_warns_where_hands_hold_it() {
    let stiff = with_gains(|gains| gains.wrench = 1.0);
    let [held, free] =
        ["pose reflection, held", "pose reflection, let go"].map(|n| found(stiff, n));
    assert!(free.right.value < held.right.value, "{free}, {held}");
    let between = f64::midpoint(free.right.value, held.right.value) / 2_000.0;
    let axis = with_gains(|gains| gains.wrench = between);
    assert_eq!(found(axis, "pose reflection, let go").verdict, Verdict::Warns);
    assert_ne!(found(axis, "pose reflection, held").verdict, Verdict::Refuses);
}

#[test]
fn reflected_rate_without_accommodation_names_accommodation() {
    let axis = with_gains(|gains| (gains.accommodation, gains.rate) = (0.0, 20.0));
    let finding = found(axis, "rate reflection, held");
    assert_eq!((finding.verdict, finding.culprit), (Verdict::Refuses, Culprit::Accommodation));
}

#[test]
fn link_lowers_the_bound_of_reflection() {
    let bound = |link_cycles| {
        let timing = Timing { link_cycles, ..AXIS.timing };
        found(Axis { timing, ..AXIS }, "rate reflection, held").right.value
    };
    let bounds = [0, 4, 16, 64].map(bound);
    assert!(bounds.is_sorted_by(|a, b| a > b), "{bounds:?}");
}

/// Bound on K_FA k_e T without lag and damper: 2 without delay; 2 tan(π/8) with the sensor mean and a cycle of a robot.
#[test]
fn arm_gives_way_half_as_fast_as_an_object() {
    for (is_robot, edge) in [(false, 2.0), (true, 0.828)] {
        let timing = Timing { is_robot, servo_lag: 0.0, ..AXIS.timing };
        let environment = Impedance { damping: 0.0, ..AXIS.environment };
        let finding = found(Axis { timing, environment, ..AXIS }, "accommodation");
        assert!((finding.right.value - edge).abs() < 1e-3, "{finding}");
    }
}

#[test]
fn values_that_are_not_finite_are_refused() {
    type Change = fn(&mut Axis, f64);
    let changes: [Change; 7] = [
        |axis, value| axis.gains.damping = value,
        |axis, value| axis.gains.wrench = value,
        |axis, value| axis.gains.rate = value,
        |axis, value| axis.environment.stiffness = value,
        |axis, value| axis.gains.accommodation = value,
        |axis, value| axis.timing.servo_lag = value,
        |axis, value| axis.hand.stiffness = value,
    ];
    for (number, change) in changes.into_iter().enumerate() {
        for value in [f64::NAN, f64::INFINITY] {
            let mut axis = AXIS;
            change(&mut axis, value);
            let refused = findings(axis).iter().any(|finding| finding.verdict == Verdict::Refuses);
            assert!(refused || axis.timing.servo_lag.is_infinite(), "change {number}, {value}");
        }
    }
}
