//! Every equation against values of independent programs (`tests/oracles/*.json`), to 1e-9. Where the paper is
//! ambiguous, the interpretation is the one called "recommended" there; the rejected ones are checked to differ.

use nalgebra::{Isometry3, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::common::oracle::{
    self, assert_near, assert_same_pose, farthest, joints, list, number, numbers, pose, rotation,
    rows, vector, wrench,
};
use crate::common::prelude::*;
use calibration::fit::{self, Direction, Sample};
use controller::assist::{self, Damping};
use controller::calibration::{Calibration, JointCalibration, TorqueCurve};
use controller::channels::Channels;
use controller::command::CommandLaw;
use controller::coupling::Coupling;
use controller::gains::Gains;
use controller::interpretation::{Difference, TorqueScaling};
use controller::limits::{AssistFraction, LimitedTorques, Limits, TorqueRequest};
use controller::orientation::Orientation;
use controller::period::Period;
use controller::reference::{Displacement, Reference};
use controller::reflection::Reflection;
use controller::velocity::{Filter, Velocity};
use units::drive::PerMille;
use units::spatial::rotation as rotations;

/// Minimum difference, far above rounding, of values that must differ.
const TINY: f64 = 1e-4;

type Joints = SVector<f64, 6>;

const MODELS: [&str; 4] = ["kraft_like", "jpl_like", "sixr_spherical", "puma560_corke_mdh"];

pub(crate) fn gains(value: &Value) -> Gains {
    Gains::new(numbers(value), "gain").unwrap()
}

/// Returns channels from the paper's deadband and parabolic constants: a plateau is `a DB²`.
pub(crate) fn channels(inputs: &Value) -> Channels {
    let deadband: [f64; 6] = numbers(&inputs["deadband"]);
    let mut plateau: [f64; 6] = numbers(&inputs["a"]);
    for (plateau, deadband) in plateau.iter_mut().zip(deadband) {
        *plateau *= deadband * deadband;
    }
    Channels::new(deadband, plateau).unwrap()
}

pub(crate) fn law(inputs: &Value) -> CommandLaw {
    CommandLaw {
        rate_gain: gains(&inputs["K_V"]),
        pose_gain: gains(&inputs["K_P"]),
        pose_deadband: false,
    }
}

/// Returns a reflection whose limits are never reached.
pub(crate) fn reflection(x_m_s: Isometry3<f64>, inputs: &Value) -> Reflection {
    Reflection::new(x_m_s, gains(&inputs["K_T"]), 1e4, 1e4).unwrap()
}

pub(crate) fn limits(inputs: &Value, scaling: TorqueScaling) -> Limits<6> {
    let fraction = AssistFraction::new(number(&inputs["assist_fraction"])).unwrap();
    Limits::new(joints(&inputs["tau_cap"]), fraction, scaling)
}

pub(crate) fn period(inputs: &Value) -> Period {
    Period::new(number(&inputs["T_cycle"])).unwrap()
}

/// Returns the twist of a grip that moves from `x_0_before` to `x_0_g` within a cycle.
fn twist_between(period: Period, x_0_before: &Isometry3<f64>, x_0_g: &Isometry3<f64>) -> Twist {
    let mut velocity = Velocity::new(period, Filter::default());
    velocity.update(x_0_before, false);
    velocity.update(x_0_g, false).v_g
}

/// Returns the damping wrench by the interpretation of the twist.
pub(crate) fn damping(
    gain: Gains,
    period: Period,
    [x_0_h, x_0_before, x_0_g]: [&Isometry3<f64>; 3],
) -> Wrench {
    let x_h_g = x_0_h.inverse() * x_0_g;
    let dx = Displacement::between(&x_h_g, Orientation::EulerZyx);
    let mut damping = Damping::new(gain, period, Difference::Twist);
    damping.wrench(&twist_between(period, x_0_before, x_0_g), &x_h_g, &dx, false)
}

/// Combines the torques under the limits, with full shares.
pub(crate) fn combine(
    limits: Limits<6>,
    gravity: Joints,
    task: Joints,
    assist: Joints,
) -> LimitedTorques<6> {
    limits.combine(&TorqueRequest { gravity, task, assist }, 1.0)
}

// Arms: Eq. 1, the Jacobian of Eq. 7, gravity.

#[test]
fn forward_kinematics_of_four_arms() {
    for model in MODELS {
        let arm = oracle::arm(model);
        for config in list(&oracle::oracle(&format!("{model}.json"))["configs"]) {
            assert_same_pose(model, &arm.forward(&joints(&config["q"])), &pose(&config["T_0G"]));
        }
    }
}

#[test]
fn body_jacobians_of_four_arms() {
    for model in MODELS {
        let arm = oracle::arm(model);
        for config in list(&oracle::oracle(&format!("{model}.json"))["configs"]) {
            let j_g = arm.jacobian(&arm.posture(&joints(&config["q"])));
            let [a, b, c, d, e, f] = rows::<6, 6>(&config["J_body_G"]);
            for (ours, reference) in [(j_g.linear, [a, b, c]), (j_g.angular, [d, e, f])] {
                let reference = SMatrix::<f64, 3, 6>::from_fn(|row, joint| reference[row][joint]);
                assert_near(model, ours.as_slice(), reference.as_slice());
            }
        }
    }
}

#[test]
fn gravity_of_four_arms() {
    for model in MODELS {
        let arm = oracle::arm(model);
        for config in list(&oracle::oracle(&format!("{model}.json"))["configs"]) {
            let tau = arm.gravity(&arm.posture(&joints(&config["q"])));
            assert_near(model, tau.as_slice(), &numbers::<6>(&config["gravity"]));
        }
    }
}

#[test]
fn mass_matrices_of_four_arms() {
    for model in MODELS {
        let arm = oracle::arm(model);
        for config in list(&oracle::oracle(&format!("{model}.json"))["configs"]) {
            let mass = arm.mass_matrix(&arm.posture(&joints(&config["q"])));
            let reference = rows::<6, 6>(&config["M"]);
            let reference = SMatrix::<f64, 6, 6>::from_fn(|row, joint| reference[row][joint]);
            assert_near(model, mass.as_slice(), reference.as_slice());
        }
    }
}

// Orientations: Eq. 4 and 5.

#[test]
fn orientations_as_three_numbers() {
    for case in list(&oracle::oracle("paper.json")["euler_cases"]) {
        let name = case["name"].as_str().unwrap();
        let r = rotation(&case["R"]);
        let (angles, reference) = (rotations::euler_zyx(&r), vector(&case["gamma_beta_alpha"]));
        let again = rotations::from_euler_zyx(&angles).to_rotation_matrix();
        assert_near(name, again.matrix().as_slice(), r.to_rotation_matrix().matrix().as_slice());
        let rotation_vector = vector(&case["rotation_vector"]);
        assert_near(name, rotations::rotation_vector(&r).as_slice(), rotation_vector.as_slice());
        // π and -π are the same angle; rounding decides the sign.
        if reference.amax() < std::f64::consts::PI - TINY {
            assert_near(name, angles.as_slice(), reference.as_slice());
            let omega = Orientation::EulerZyx.rate(&angles);
            assert_near(name, omega.as_slice(), vector(&case["omega_eq5"]).as_slice());
            let determinant = rotations::euler_rates(&angles).determinant();
            assert_near(name, &[determinant], &[number(&case["det_E"])]);
        }
    }
}

// The worked example, equation by equation.

#[test]
fn the_deadband_and_the_return_force_of_one_axis() {
    let table = &oracle::oracle("paper.json")["eq8"]["table"];
    let [a, deadband, wall, stiffness] =
        ["a", "db", "wall", "k_wall"].map(|key| number(&table[key]));
    let channels = Channels::new([deadband; 6], [a * deadband * deadband; 6]).unwrap();
    let walled = channels.with_wall([wall; 6], [stiffness; 6]).unwrap();
    let column = |key: &str| list(&table[key]).iter().map(number).collect::<Vec<_>>();
    let x = column("x");
    let each = |law: &dyn Fn(&Displacement) -> [f64; 6]| {
        let along = |x: &f64| law(&Displacement::from_components([*x, 0.0, 0.0, 0.0, 0.0, 0.0]))[0];
        x.iter().map(along).collect::<Vec<_>>()
    };
    assert_near("odd", &each(&|dx| channels.centring(dx)), &column("F_odd"));
    assert_near("wall", &each(&|dx| walled.centring(dx)), &column("F_odd_wall"));
    let left = each(&|dx| channels.beyond_deadband(dx).components());
    assert_near("deadband", &left, &column("dX_db"));
}

#[test]
fn eq_8_as_printed_differs_from_the_oracle() {
    let table = &oracle::oracle("paper.json")["eq8"]["table"];
    let printed = list(&table["F_literal"]).iter().map(number).collect::<Vec<_>>();
    let odd = list(&table["F_odd"]).iter().map(number).collect::<Vec<_>>();
    let x = list(&table["x"]).iter().map(number).collect::<Vec<_>>();
    for ((printed, odd), x) in printed.iter().zip(&odd).zip(&x) {
        if *x < 0.0 {
            assert!(printed * x > 0.0, "as printed it drives the grip outwards at {x} m");
            assert!((printed - odd).abs() > TINY);
        }
    }
}

#[test]
fn jacobian_in_the_wrong_frame_is_detected() {
    let paper = oracle::oracle("paper.json");
    let arm = oracle::arm("sixr_spherical");
    let j_g = arm.jacobian(&arm.posture(&joints(&paper["inputs"]["q_now"])));
    let tau = j_g.torques(&wrench(&paper["eq6b"]["G_F_T"]));
    let right = numbers::<6>(&paper["eq7"]["tau_T"]);
    let wrong = numbers::<6>(&paper["eq7_wrong_if_frame_mixed"]["tau_if_J0_used_with_W_wrench"]);
    assert_near("tau_task", tau.as_slice(), &right);
    assert!(farthest(tau.as_slice(), &wrong) > 0.1);
}

#[test]
fn equivalent_wrist_wrench_gives_equal_torques() {
    let paper = oracle::oracle("paper.json");
    let f_g = wrench(&paper["eq6b"]["G_F_T"]);
    let f_w = f_g.at(&pose(&paper["eq6b"]["T_W_G"]));
    assert_near("f_w", &f_w.components(), &numbers::<6>(&paper["eq6b"]["W_F_T"]));
    let j_w = rows::<6, 6>(&paper["eq7"]["J_W_in_W"]);
    let mut tau = [0.0; 6];
    for (row, part) in j_w.iter().zip(f_w.components()) {
        for (torque, entry) in tau.iter_mut().zip(row) {
            *torque += entry * part;
        }
    }
    assert_near("tau", &tau, &numbers::<6>(&paper["eq7"]["tau_T_via_J_G"]));
}

#[test]
fn gravity_is_not_one_wrench_at_the_grip() {
    let paper = oracle::oracle("paper.json");
    let arm = oracle::arm("sixr_spherical");
    let tau = arm.gravity(&arm.posture(&joints(&paper["inputs"]["q_now"])));
    let per_link = numbers::<6>(&paper["gravity"]["tau_GC_recommended_per_link"]);
    assert_near("gravity", tau.as_slice(), &per_link);
    let lumped = numbers::<6>(&paper["gravity"]["tau_GC_literal"]);
    assert!(farthest(tau.as_slice(), &lumped) > 1.0);
}

#[test]
fn centring_and_damping_act_at_any_orientation() {
    let paper = oracle::oracle("paper.json");
    for case in list(&paper["frame_mismatch_power"]["cases"]) {
        let yaw = number(&case["G_yaw_deg"]).to_radians();
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let x_0_h = Isometry3::identity();
        let x_0_g = Isometry3::from_parts(Vector3::new(0.05, 0.0, 0.0).into(), turned);
        let x_0_before = Isometry3::from_parts(Vector3::new(0.0499, 0.0, 0.0).into(), turned);
        let mut reference = Reference::none();
        reference.x_0_h = x_0_h;
        let x_h_g = reference.displacement(&x_0_g);
        let dx = Displacement::between(&x_h_g, Orientation::EulerZyx);
        let v_g = Twist {
            linear: x_0_g.rotation.inverse() * Vector3::new(0.1, 0.0, 0.0),
            angular: Vector3::zeros(),
        };
        let channels = Channels::new([0.01; 6], [3.0, 3.0, 3.0, 0.3, 0.3, 0.3]).unwrap();
        let r_g_h = x_h_g.rotation.inverse();
        let f_g = assist::centring(&channels, Orientation::EulerZyx, &r_g_h, &dx);
        assert_near("return", &[f_g.power(&v_g)], &[number(&case["consistent_power_RTC"])]);
        let gain = Gains::new([6.0, 6.0, 6.0, 0.05, 0.05, 0.05], "K_D").unwrap();
        let f_g = damping(gain, Period::new(1e-3).unwrap(), [&x_0_h, &x_0_before, &x_0_g]);
        assert_near("damper", &[f_g.power(&v_g)], &[number(&case["consistent_power_damper"])]);
        let literal = assist::centring_by_components(&channels, &dx.along(&x_0_h.rotation));
        let power = number(&case["literal_power_on_hand_RTC"]);
        assert_near("return, as printed", &[literal.power(&v_g)], &[power]);
    }
}

#[test]
fn saturation() {
    let cases = &oracle::oracle("paper.json")["saturation_cases"];
    let none = Joints::zeros();
    for case in list(&cases["uniform"]) {
        let fraction = AssistFraction::new(number(&case["fraction"])).unwrap();
        let limits = Limits::new(joints(&case["cap"]), fraction, TorqueScaling::GravityExempt);
        let limited = combine(limits, none, none, joints(&case["tau"]));
        assert_near("scale", &[limited.assist_scale], &[number(&case["scale"])]);
        assert_near("tau", limited.tau.as_slice(), &numbers::<6>(&case["out"]));
    }
    for case in list(&cases["gravity_exempt"]) {
        let whole = AssistFraction::new(1.0).unwrap();
        let limits = Limits::new(joints(&case["cap"]), whole, TorqueScaling::GravityExempt);
        let limited = combine(limits, joints(&case["tau_g"]), joints(&case["tau_rest"]), none);
        assert_near("scale", &[limited.rest_scale], &[number(&case["scale"])]);
        assert_near("tau", limited.tau.as_slice(), &numbers::<6>(&case["out"]));
    }
}

// Torque curves.

/// Returns the calibration of the worked example: one count is 0.001 rad.
pub(crate) fn calibration(paper: &Value) -> Calibration<6> {
    let caps = numbers::<6>(&paper["inputs"]["tau_cap"]);
    let ratios = numbers::<6>(&paper["inputs"]["gear_ratio"]);
    let curves = rows::<6, 3>(&paper["actuation"]["curve_coefficients"]);
    Calibration::new([0, 1, 2, 3, 4, 5].map(|joint| {
        let curve = TorqueCurve::new(curves[joint], caps[joint]).unwrap();
        let ratio = std::f64::consts::TAU.copysign(ratios[joint]);
        JointCalibration::new(1_000, ratio, 0, curve).unwrap()
    }))
}

/// Returns the oracle's targets, with the direction of each motor applied.
pub(crate) fn expected_targets(paper: &Value) -> [PerMille; 6] {
    let counts = list(&paper["actuation"]["counts"]);
    let ratios = numbers::<6>(&paper["inputs"]["gear_ratio"]);
    [0, 1, 2, 3, 4, 5].map(|joint| {
        let count = i16::try_from(counts[joint].as_i64().unwrap()).unwrap();
        PerMille(if ratios[joint] < 0.0 { -count } else { count })
    })
}

#[test]
fn torques_convert_to_the_exact_counts() {
    let paper = oracle::oracle("paper.json");
    let targets = calibration(&paper).targets(&joints(&paper["actuation"]["tau_C"]));
    assert_eq!(targets, expected_targets(&paper));
}

#[test]
fn a_torque_curve_and_its_inverse() {
    let table = &oracle::oracle("paper.json")["torque_curve"];
    let [_, max_torque] = numbers::<2>(&table["domain"]);
    let curve = TorqueCurve::new(numbers(&table["coeffs_c1_c3_c5"]), max_torque).unwrap();
    let joint = JointCalibration::new(1_000, 1.0, 0, curve).unwrap();
    let calibration = Calibration::new([joint]);
    let torques = list(&table["samples_torque"]).iter().map(number);
    for (torque, counts) in torques.zip(list(&table["samples_counts"]).iter().map(number)) {
        let [PerMille(target)] = calibration.targets(&SVector::from([torque]));
        assert!((f64::from(target) - counts).abs() <= 0.5);
    }
    let inverse = &table["inverse"];
    let counts = [-1500, -900, -250, -1, 0, 1, 250, 900, 1500, 1750];
    assert_near("counts", &counts.map(f64::from), &numbers::<10>(&inverse["counts"]));
    for (counts, torque) in counts.into_iter().zip(list(&inverse["torque"])) {
        let ours = calibration.torques(&[PerMille(counts)]);
        assert_near("torque", ours.as_slice(), &[number(torque)]);
    }
}

#[test]
fn coupled_actuators() {
    let case = &oracle::oracle("paper.json")["coupling"];
    let coupling = Coupling::new(rows::<6, 6>(&case["C"]), [0.0; 6]).unwrap();
    let theta = coupling.joints(&joints(&case["measured"]));
    assert_near("theta", theta.as_slice(), &numbers::<6>(&case["theta"]));
    let tau_a = coupling.at_actuators(&joints(&case["tau_joint"]));
    assert_near("tau_actuator", tau_a.as_slice(), &numbers::<6>(&case["tau_actuator"]));
}

#[test]
fn a_torque_curve_from_measurements() {
    let table = &oracle::oracle("paper.json")["torque_curve"];
    let samples = |counts: &Value| -> Vec<Sample> {
        let pairs = list(&table["samples_torque"]).iter().zip(list(counts));
        let sample = |(torque, counts)| Sample {
            torque: number(torque),
            per_mille: number(counts),
            direction: Direction::Up,
        };
        pairs.map(sample).collect()
    };
    let fitted = fit::odd(&samples(&table["samples_counts"])).unwrap();
    assert_near("fit", &fitted.coefficients, &numbers::<3>(&table["fit_odd"]));
    let noisy = samples(&table["noisy_counts"]);
    let fitted = fit::odd(&noisy).unwrap();
    assert_near("noisy fit", &fitted.coefficients, &numbers::<3>(&table["noisy_fit_odd"]));
    assert_near(
        "residual",
        &[fitted.residuals.rms, fit::line(&noisy).unwrap().residuals.rms],
        &[number(&table["noisy_fit_rms_residual"]), number(&table["linear_fit_rms_residual"])],
    );
    let [_, max_torque] = numbers::<2>(&table["domain"]);
    let curve = TorqueCurve::new(numbers(&table["coeffs_c1_c3_c5"]), max_torque).unwrap();
    // The reference is the minimum over samples, so it is an upper bound.
    let above = number(&table["min_slope_on_domain"]) - curve.least_slope().0;
    assert!((0.0..1e-3).contains(&above), "{above}");
}
