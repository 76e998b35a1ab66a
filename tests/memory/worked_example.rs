//! Complete cycles of the controller against the oracles: the worked example of the paper, random cycles, both as printed too.

use nalgebra::{Isometry3, SVector, UnitQuaternion, Vector3};

use crate::common::oracle::{
    self, assert_near, assert_same_pose, joints, list, number, numbers, pose, vector, wrench,
};
use crate::common::prelude::*;
use crate::oracles::{
    calibration, channels, combine, damping, expected_targets, gains, law, limits, period,
    reflection,
};
use controller::arm::{Arm, JointKind, Link, Posture};
use controller::assist::{self, Damping};
use controller::channels::Channels;
use controller::command::CommandLaw;
use controller::gains::Gains;
use controller::interpretation::{Difference, Interpretation, TorqueScaling};
use controller::limits::AssistFraction;
use controller::orientation::Orientation;
use controller::reference::{Displacement, Reference};
use controller::switches::{CommandMode, SwitchLogic, Switches};
use controller::{Controller, Extensions, Input, Output, Settings};
use units::drive::Counts;
use units::spatial::rotation as rotations;
// The complete step.

/// Runs the worked example: hold the deadman, set the reference, move.
fn settings(paper: &Value, interpretation: Interpretation) -> Settings {
    let inputs = &paper["inputs"];
    Settings {
        interpretation,
        period: period(inputs),
        arm: oracle::arm("sixr_spherical"),
        calibration: calibration(paper),
        channels: channels(inputs),
        command: law(inputs),
        reflection: reflection(pose(&paper["eq6"]["T_MRF_S"]), inputs),
        damping: gains(&inputs["K_D_SI"]),
        assist_fraction: AssistFraction::new(number(&inputs["assist_fraction"])).unwrap(),
        bounds: controller::adjustment::Bounds::FIXED,
        dry_friction: controller::JointVector::zeros(),
        extensions: Extensions::default(),
    }
}

fn worked_example(paper: &Value, mode: CommandMode, interpretation: Interpretation) -> Output {
    let inputs = &paper["inputs"];
    let settings = settings(paper, interpretation);
    let mut controller = Controller::new(&settings);
    let up = Switches::default();
    let deadman = Switches { deadman: true, ..up };
    let pressed = Switches { reference: true, reflection: true, ..deadman };
    let mut output = None;
    for (q, switches, restart) in [
        ("q_ref", up, true),
        ("q_ref", pressed, false),
        ("q_prev", deadman, false),
        ("q_now", deadman, false),
    ] {
        let counts = settings.calibration.counts(&joints(&inputs[q]));
        output = Some(controller.step(&Input {
            counts,
            f_s: wrench(&paper["payload"]["F_S_after_static_removal"]),
            x_b_m: pose(&paper["pose_mode"]["T_ref_object"]),
            switches,
            mode,
            gravity_share: 1.0,
            reflection_share: 1.0,
            hold: false,
            held: None,
            restart,
        }));
    }
    output.unwrap()
}

#[test]
fn the_worked_example_in_rate_mode() {
    let paper = oracle::oracle("paper.json");
    let output = worked_example(&paper, CommandMode::Rate, Interpretation::CONSISTENT);
    assert_near("q", output.q.as_slice(), &numbers::<6>(&paper["inputs"]["q_now"]));
    assert_same_pose("Eq. 1", &output.x_0_g, &pose(&paper["eq1"]["T_0G"]));
    assert_same_pose("reference", &output.reference.x_0_h, &pose(&paper["eq1"]["T_0G0"]));
    let near = |what: &str, ours: [f64; 6], reference: &Value| {
        assert_near(what, &ours, &numbers::<6>(reference));
    };
    near("dx", output.dx.components(), &paper["eq4"]["dX_recommended"]);
    near("dx_db", output.dx_db.components(), &paper["deadband"]["dX_db_recommended"]);
    let Motion::Rate(v_m) = output.command else { panic!("{:?}", output.command) };
    near("v_m", v_m.components(), &paper["eq5"]["rate_command_recommended"]);
    near("f_m_task", output.f_m_task.components(), &paper["eq6"]["F_MRF_T"]);
    near("f_g_task", output.f_g_task.components(), &paper["eq6b"]["G_F_T"]);
    let ledger = &output.ledger;
    near("tau_task", ledger.task.into(), &paper["eq7"]["tau_T"]);
    near("centring", output.f_g_centring.components(), &paper["eq8"]["G_F_R_recommended"]);
    near("damping", output.f_g_damping.components(), &paper["eq9"]["G_F_D_recommended"]);
    let total = &paper["eq10"]["recommended"];
    near("tau_assist", (ledger.centring + ledger.damping).into(), &total["tau_assist"]);
    near("tau_gravity", ledger.gravity.into(), &total["tau_gravity"]);
    let scales = [ledger.assist_scale, ledger.rest_scale];
    let expected = [number(&total["assist_scale"]), number(&total["rest_scale"])];
    assert_near("scales", &scales, &expected);
    near("tau", output.tau.into(), &total["tau_C"]);
    assert_eq!(ledger.limiting_joint, Some(Joint::of::<2>()));
    assert_eq!(output.targets, expected_targets(&paper));
    assert_eq!(output.invalid_value, None);
}

#[test]
fn the_worked_example_in_pose_mode() {
    let paper = oracle::oracle("paper.json");
    let output = worked_example(&paper, CommandMode::Pose, Interpretation::CONSISTENT);
    let Motion::Pose(x_b_d) = output.command else { panic!("{:?}", output.command) };
    let reference = pose(&paper["pose_mode"]["T_cmd_recommended_body_composition"]);
    assert_same_pose("x_b_d", &x_b_d, &reference);
    assert_eq!(output.f_g_centring, Wrench::ZERO);

    let with_deadband = CommandLaw { pose_deadband: true, ..law(&paper["inputs"]) };
    let left = with_deadband.effective(CommandMode::Pose, &channels(&paper["inputs"]), &output.dx);
    let x_b_d = with_deadband.pose(&Interpretation::CONSISTENT, &output.reference, &left);
    let reference = pose(&paper["pose_mode"]["T_cmd_recommended_with_deadband"]);
    assert_same_pose("x_b_d with deadband", &x_b_d, &reference);
}

#[test]
fn the_return_moment_of_a_rotation_vector() {
    let paper = oracle::oracle("paper.json");
    let x_h_g = pose(&paper["eq1"]["T_0G0"]).inverse() * pose(&paper["eq1"]["T_0G"]);
    let dx = Displacement::between(&x_h_g, Orientation::RotationVector);
    let numbers_of_it = vector(&paper["eq4"]["rotation_vector"]);
    assert_near("rotation vector", dx.orientation.as_slice(), numbers_of_it.as_slice());
    let channels = channels(&paper["inputs"]);
    let r_g_h = x_h_g.rotation.inverse();
    let f_g = assist::centring(&channels, Orientation::RotationVector, &r_g_h, &dx);
    let reference = &paper["eq8"]["G_F_R_rotation_vector_variant"];
    assert_near("centring", &f_g.components(), &numbers::<6>(reference));
}

#[test]
fn closed_loop_of_orientations_gains_no_energy() {
    let case = &oracle::oracle("paper.json")["euler_moment_loop_work"];
    let channels = Channels::new([0.05; 6], [0.3; 6]).unwrap();
    let steps = 4_000_u32;
    let dt = std::f64::consts::TAU / f64::from(steps);
    let (mut printed, mut conjugate) = (0.0, 0.0);
    for step in 0..steps {
        let t = dt * f64::from(step);
        let phi =
            Vector3::new(0.5, 0.6, 0.5) + Vector3::new(t.cos(), t.sin(), (2.0 * t).sin()) * 0.35;
        let phi_rate = Vector3::new(-t.sin(), t.cos(), 2.0 * (2.0 * t).cos()) * 0.35;
        let omega = rotations::euler_rates(&phi) * phi_rate;
        let dx = Displacement { translation: Vector3::zeros(), orientation: phi };
        let still = UnitQuaternion::identity();
        let ours = assist::centring(&channels, Orientation::EulerZyx, &still, &dx).moment;
        conjugate += ours.dot(&omega) * dt;
        printed += assist::centring_by_components(&channels, &dx).moment.dot(&omega) * dt;
    }
    // The reference uses another integration rule, exact to 1e-8.
    assert!((printed.abs() - number(&case["literal_body_moment"])).abs() < 1e-8);
    assert_near("conjugate", &[conjugate], &[0.0]);
}

#[test]
fn random_cycles() {
    for case in list(&oracle::oracle("paper_random.json")["cases"]) {
        let (inputs, expected) = (&case["inputs"], &case["expected"]);
        let near = |what: &str, ours: [f64; 6], key: &str| {
            assert_near(what, &ours, &numbers::<6>(&expected[key]));
        };
        let arm = oracle::arm(case["device"].as_str().unwrap());
        let channels = channels(inputs);
        let law = law(inputs);

        let mut reference = Reference::none();
        reference.x_0_h = arm.forward(&joints(&inputs["q_ref"]));
        reference.x_b_r = pose(&inputs["T_ref_object"]);
        let posture = arm.posture(&joints(&inputs["q_now"]));
        let x_0_g = posture.x_0_g;
        assert_same_pose("x_0_h", &reference.x_0_h, &pose(&expected["T_0G0"]));
        assert_same_pose("x_0_g", &x_0_g, &pose(&expected["T_0G"]));

        let x_h_g = reference.displacement(&x_0_g);
        let interpretation = Interpretation::CONSISTENT;
        let dx = reference.dx(&interpretation, &x_h_g);
        let dx_db = law.effective(CommandMode::Rate, &channels, &dx);
        near("dx", dx.components(), "dX_recommended");
        near("dx_db", dx_db.components(), "dX_db");
        near("v_m", law.rate(Orientation::EulerZyx, &dx_db).components(), "rate_command");
        let x_b_d = law.pose(&interpretation, &reference, &dx);
        assert_same_pose("x_b_d", &x_b_d, &pose(&expected["pose_command"]));

        let reflection = reflection(pose(&inputs["T_MRF_S"]), inputs);
        let f_m_task = reflection.at_object(&wrench(&inputs["F_S_contact"]));
        let f_g_task = reflection.at_grip(&f_m_task);
        near("f_m_task", f_m_task.components(), "F_MRF_T");
        near("f_g_task", f_g_task.components(), "G_F_T");

        let r_g_h = x_h_g.rotation.inverse();
        let f_g_centring = assist::centring(&channels, Orientation::EulerZyx, &r_g_h, &dx);
        near("centring", f_g_centring.components(), "G_F_R");
        let vector = Displacement::between(&x_h_g, Orientation::RotationVector);
        let other = assist::centring(&channels, Orientation::RotationVector, &r_g_h, &vector);
        near("centring by rotation vector", other.components(), "G_F_R_rotation_vector");
        let x_0_before = arm.forward(&joints(&inputs["q_prev"]));
        let way = [&reference.x_0_h, &x_0_before, &x_0_g];
        let f_g_damping = damping(gains(&inputs["K_D_SI"]), period(inputs), way);
        near("damping", f_g_damping.components(), "G_F_D");

        let j_g = arm.jacobian(&posture);
        let tau_task = j_g.torques(&f_g_task);
        let tau_assist = j_g.torques(&(f_g_centring + f_g_damping));
        let tau_gravity = arm.gravity(&posture);
        near("tau_task", tau_task.into(), "tau_T");
        near("tau_assist", tau_assist.into(), "tau_assist");
        near("tau_gravity", tau_gravity.into(), "tau_gravity");
        let limits = limits(inputs, TorqueScaling::GravityExempt);
        let limited = combine(limits, tau_gravity, tau_task, tau_assist);
        let scales = [limited.assist_scale, limited.rest_scale];
        let expected_scales = ["assist_scale", "rest_scale"].map(|key| number(&expected[key]));
        assert_near("scales", &scales, &expected_scales);
        near("tau", limited.tau.into(), "tau_C");

        let none = arm.balanced().gravity(&posture);
        let balanced = combine(limits, none, tau_task, tau_assist);
        near("tau, balanced", balanced.tau.into(), "no_gravity_tau_C");
        let scale = number(&expected["no_gravity_final_scale"]);
        assert_near("scale, balanced", &[balanced.rest_scale], &[scale]);
    }
}

// The paper's equations as printed.

#[test]
fn the_worked_example_as_printed() {
    let paper = oracle::oracle("paper.json");
    let output = worked_example(&paper, CommandMode::Rate, Interpretation::PAPER_1997);
    let near = |what: &str, ours: [f64; 6], reference: &Value| {
        assert_near(what, &ours, &numbers::<6>(reference));
    };
    near("dx", output.dx.components(), &paper["eq4"]["dX_literal"]);
    near("dx_db", output.dx_db.components(), &paper["deadband"]["dX_db_literal"]);
    let Motion::Rate(v_m) = output.command else { panic!("{:?}", output.command) };
    near("v_m", v_m.components(), &paper["eq5"]["rate_command_literal"]);
    near("f_g_task", output.f_g_task.components(), &paper["eq6b"]["G_F_T"]);
    let centring = &paper["eq8"]["G_F_R_literal_components_used_as_G"];
    near("centring", output.f_g_centring.components(), centring);
    near("damping", output.f_g_damping.components(), &paper["eq9"]["G_F_D_literal"]);
    let ledger = &output.ledger;
    near("gravity", ledger.gravity.into(), &paper["gravity"]["tau_GC_literal"]);
    let total = &paper["eq10"]["literal"];
    let tau_rg = ledger.gravity + ledger.centring + ledger.damping;
    near("tau_RG", tau_rg.into(), &total["tau_RG"]);
    let scales = [ledger.assist_scale, ledger.rest_scale];
    let expected = [number(&total["assist_scale"]), number(&total["final_scale"])];
    assert_near("scales", &scales, &expected);
    near("tau", output.tau.into(), &total["tau_C"]);
}

#[test]
fn the_pose_command_as_printed() {
    let paper = oracle::oracle("paper.json");
    let output = worked_example(&paper, CommandMode::Pose, Interpretation::PAPER_1997);
    let Motion::Pose(x_b_d) = output.command else { panic!("{:?}", output.command) };
    let reference = pose(&paper["pose_mode"]["T_cmd_translation_in_world_literal"]);
    assert_same_pose("x_b_d", &x_b_d, &reference);
}

#[test]
fn random_cycles_as_printed() {
    for case in list(&oracle::oracle("paper_random.json")["cases"]) {
        let (inputs, expected) = (&case["inputs"], &case["expected"]["literal"]);
        let near = |what: &str, ours: [f64; 6]| {
            assert_near(what, &ours, &numbers::<6>(&expected[what]));
        };
        let arm = oracle::arm(case["device"].as_str().unwrap());
        let [at_reference, before, now] =
            ["q_ref", "q_prev", "q_now"].map(|key| arm.posture(&joints(&inputs[key])));
        let mut reference = Reference::none();
        reference.x_0_h = at_reference.x_0_g;
        let dx = |posture: &Posture<6>| {
            let x_h_g = reference.displacement(&posture.x_0_g);
            (reference.dx(&Interpretation::PAPER_1997, &x_h_g), x_h_g)
        };
        let ((dx_before, x_h_before), (dx_now, x_h_g)) = (dx(&before), dx(&now));
        let literal = numbers::<6>(&case["expected"]["dX_literal"]);
        assert_near("dX_literal", &dx_now.components(), &literal);

        let j_g = arm.jacobian(&now);
        let carried = arm.gravity_at_grip(&now);
        let centring = assist::centring_by_components(&channels(inputs), &dx_now);
        let gain = gains(&inputs["K_D_SI"]);
        let mut damping = Damping::new(gain, period(inputs), Difference::Components);
        damping.wrench(&Twist::ZERO, &x_h_before, &dx_before, false);
        let damped = damping.wrench(&Twist::ZERO, &x_h_g, &dx_now, false);
        near("G_F_GC", carried.components());
        near("G_F_R", centring.components());
        near("G_F_D", damped.components());

        let (tau_gravity, tau_assist) = (j_g.torques(&carried), j_g.torques(&(centring + damped)));
        near("tau_RG", (tau_gravity + tau_assist).into());
        let tau_task = j_g.torques(&wrench(&case["expected"]["G_F_T"]));
        let limits = limits(inputs, TorqueScaling::AssistWithGravity);
        let limited = combine(limits, tau_gravity, tau_task, tau_assist);
        assert_near("scale", &[limited.assist_scale], &[number(&expected["assist_scale"])]);
        assert_near("scale", &[limited.rest_scale], &[number(&expected["final_scale"])]);
        near("tau_C", limited.tau.into());
    }
}

#[test]
fn gravity_read_correctly_but_scaled_as_printed() {
    let paper = oracle::oracle("paper.json");
    let interpretation =
        Interpretation { scaling: TorqueScaling::AssistWithGravity, ..Interpretation::CONSISTENT };
    let output = worked_example(&paper, CommandMode::Rate, interpretation);
    let total = &paper["eq10"]["minimal_fix"];
    assert_near("scale", &[output.ledger.assist_scale], &[number(&total["assist_scale"])]);
    assert_near("tau", output.tau.as_slice(), &numbers::<6>(&total["tau_C"]));
}

// Switches.

#[test]
fn switch_permissions() {
    for row in list(&oracle::oracle("paper.json")["switch_truth_table"]["rows"]) {
        let is = |key: &str| row[key].as_bool().unwrap_or_else(|| number(&row[key]) > 0.5);
        let mut switches = SwitchLogic::new(CommandMode::Rate, true);
        switches.read(Switches::default(), CommandMode::Rate);
        let levels = Switches {
            deadman: is("deadman"),
            reflection: is("reflection_enabled"), // the press that enables it
            reference: false,
        };
        for mode in [CommandMode::Rate, CommandMode::Pose] {
            let mut switches = switches;
            let pressed = switches.read(levels, mode);
            assert_eq!(pressed.commands, is("commands"), "{row}");
            assert_eq!(pressed.task, is("task_wrench"), "{row}");
            assert_eq!(pressed.damping, is("damping"), "{row}");
            assert_eq!(pressed.centring, is("rtc_rate_mode") && mode == CommandMode::Rate, "{row}");
        }
    }
}

#[test]
fn indexing_through_a_large_workspace() {
    let sequence = &oracle::oracle("paper.json")["index_sequence_pose_mode"];
    let paper = oracle::oracle("paper.json");
    let gain = number(&sequence["K_P"]);
    let mut settings = settings(&paper, Interpretation::CONSISTENT);
    settings.command.pose_gain = Gains::new([gain; 6], "K_P").unwrap();
    settings.arm = gantry();
    let mut controller = Controller::new(&settings);
    let mut object = Isometry3::identity();
    for row in list(&sequence["trace"]) {
        let is = |key: &str| number(&row[key]) > 0.5;
        let grip = SVector::from([number(&row["grip"]), 0.0, 0.0, 0.0, 0.0, 0.0]);
        let output = controller.step(&Input {
            counts: settings.calibration.counts(&grip),
            f_s: Wrench::ZERO,
            x_b_m: object,
            switches: Switches {
                deadman: is("deadman"),
                reference: is("ref_switch"),
                reflection: false,
            },
            mode: CommandMode::Pose,
            gravity_share: 1.0,
            reflection_share: 1.0,
            hold: false,
            held: None,
            restart: false,
        });
        if let Motion::Pose(x_b_d) = output.command {
            object = x_b_d;
        }
        assert_eq!(output.command == Motion::Hold, !is("deadman"), "{row}");
        assert_near(&row.to_string(), &[object.translation.z], &[number(&row["object_cmd"])]);
    }
}

/// Returns six prismatic joints along z of {0}.
fn gantry() -> Arm<6> {
    let slide = Link { kind: JointKind::Prismatic, mass: 1.0, range: [-1.0, 1.0], ..Link::TURNING };
    Arm::new([slide; 6], Isometry3::identity(), [0.0; 3]).unwrap()
}

#[test]
fn counts_are_exact_in_the_worked_example() {
    let paper = oracle::oracle("paper.json");
    let calibration = calibration(&paper);
    let counts = calibration.counts(&joints(&paper["inputs"]["q_now"]));
    assert_eq!(counts[0], Counts(420));
    assert_eq!(counts[1], Counts(500)); // -0.5 rad; the motor rotates against the joint
}
