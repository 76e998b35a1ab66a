//! Properties of a controller cycle for any joints, wrench and switches: power is conserved, outputs are continuous,
//! no motion is uncommanded, and invalid inputs have no effect.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::common::oracle;
use crate::common::prelude::*;
use crate::controller_steps::{
    Bench, DEADMAN, MAX_TORQUES, NEUTRAL, PERIOD, REFERENCE, UP, any_float, any_pose, as_printed,
    by_rotation_vector, everything, joints, mode, settings, switches, wrench,
};
use controller::arm::{Arm, Link};
use controller::command::Gate;
use controller::gains::Gains;
use controller::switches::CommandMode;
use controller::{Controller, Extensions, Input, JointVector, Output, Settings};
use units::drive::Counts;

/// Returns the oracle's arm on a base that is rotated about x and shifted; gravity rotates with it.
fn kraft_like_on(alpha: f64, a: f64, d: f64) -> Arm<6> {
    let model = &oracle::oracle("kraft_like.json")["model"];
    let mut links = oracle::links(model);
    links[0] =
        Link { alpha: links[0].alpha + alpha, a: links[0].a + a, d: links[0].d + d, ..links[0] };
    let turned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), alpha);
    let gravity = turned * oracle::vector(&model["g0"]);
    Arm::new(links, oracle::pose(&model["T_6G"]), gravity.into()).unwrap()
}

proptest! {
    #[test]
    fn property_02_joint_torques_do_the_work_of_the_grip_wrench(
        q in joints(), qd in prop::array::uniform6(-2.0..2.0_f64), f_s in wrench(20.0)
    ) {
        let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
        bench.input.f_s = f_s;
        let output = bench.at(q);
        let qd = JointVector::from(qd);
        let v_g = output.j_g.twist(&qd);
        let task = output.ledger.task.dot(&qd) - output.f_g_task.power(&v_g);
        let f_g_assist = output.f_g_centring + output.f_g_damping;
        let assist = (output.ledger.centring + output.ledger.damping).dot(&qd) - f_g_assist.power(&v_g);
        prop_assert!(output.f_g_task != Wrench::ZERO && f_g_assist != Wrench::ZERO);
        prop_assert!(task.abs() < 1e-9 && assist.abs() < 1e-9, "{task} W, {assist} W");
    }

    #[test]
    fn pose_mode_power_at_hand_and_object_is_equal(
        q in joints(), qd in prop::array::uniform6(-1.0..1.0_f64), f_s in wrench(20.0)
    ) {
        // At unit gains, object and hand have equal twists and wrenches.
        let mut bench = Bench::engaged(&settings(), CommandMode::Pose);
        bench.input.f_s = f_s;
        let before = bench.at(q);
        let after = bench.at([0, 1, 2, 3, 4, 5].map(|joint| q[joint] + qd[joint] * PERIOD));
        let (Motion::Pose(x_b_before), Motion::Pose(x_b_d)) = (before.command, after.command)
        else {
            return Err(TestCaseError::fail("no pose commanded"));
        };
        let v_m = Twist::reaching(&(x_b_before.inverse() * x_b_d), PERIOD);
        let v_g = Twist::reaching(&(before.x_0_g.inverse() * after.x_0_g), PERIOD);
        let difference = after.f_m_task.power(&v_m) - after.f_g_task.power(&v_g);
        prop_assert!(difference.abs() < 1e-7, "{difference} W of difference");
    }

    #[test]
    fn moved_base_changes_no_torque_and_no_command(
        q in joints(), f_s in wrench(20.0), mode in mode(),
        [alpha, a, d] in prop::array::uniform3(-1.0..1.0_f64)
    ) {
        let here = settings();
        let there = Settings { arm: kraft_like_on(alpha, a, d), ..here };
        let outputs = [here, there].map(|settings| {
            let mut bench = Bench::engaged(&settings, mode);
            bench.input.f_s = f_s;
            bench.at(q)
        });
        let [here, there] = outputs;
        prop_assert!((here.x_0_g.translation.vector - there.x_0_g.translation.vector).norm() > 0.0);
        prop_assert!((here.tau - there.tau).norm() < 1e-9);
        match (here.command, there.command) {
            (Motion::Rate(here), Motion::Rate(there)) => {
                for (here, there) in here.components().iter().zip(there.components()) {
                    prop_assert!((here - there).abs() < 1e-9);
                }
            }
            (Motion::Pose(here), Motion::Pose(there)) => {
                let difference = here.to_homogeneous() - there.to_homogeneous();
                prop_assert!(difference.norm() < 1e-9);
            }
            (here, there) => prop_assert!(false, "{here:?} here, {there:?} there"),
        }
    }

    #[test]
    fn property_05_damping_never_drives_the_hand(path in prop::collection::vec(joints(), 2..6)) {
        let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
        let mut x_0_before = None;
        for q in path {
            let output = bench.at(q);
            if let Some(x_0_before) = x_0_before.replace(output.x_0_g) {
                let moved: Isometry3<f64> = output.x_0_g.inverse() * x_0_before;
                let moved_in_g = -moved.translation.vector;
                prop_assert!(output.f_g_damping.force.dot(&moved_in_g) <= 0.0);
                let turned = -moved.rotation.scaled_axis();
                prop_assert!(output.f_g_damping.moment.dot(&turned) <= 0.0);
            }
        }
    }

    #[test]
    fn resting_hand_commands_no_motion(mode in mode(), cycles in 1..20_usize) {
        let mut bench = Bench::engaged(&settings(), mode);
        for _ in 0..cycles {
            let output = bench.at(NEUTRAL);
            match output.command {
                Motion::Rate(v_m) => prop_assert_eq!(v_m, Twist::ZERO),
                Motion::Pose(x_b_d) => {
                    let moved = x_b_d.to_homogeneous() - bench.input.x_b_m.to_homogeneous();
                    prop_assert!(moved.norm() < 1e-14);
                }
                Motion::Hold => prop_assert!(false, "Hold while engaged"),
            }
            prop_assert!((output.tau - output.ledger.gravity).norm() < 1e-12);
            prop_assert_eq!(output.invalid_value, None);
        }
    }

    #[test]
    fn released_deadman_leaves_gravity_torque_and_no_command(
        path in prop::collection::vec((joints(), switches(), wrench(50.0)), 1..20), mode in mode()
    ) {
        let unslewed = Extensions { slew: None, ..everything().extensions };
        for settings in [settings(), Settings { extensions: unslewed, ..everything() }] {
            let mut bench = Bench::new(&settings, mode);
            for (q, switches, f_s) in &path {
                bench.input.switches = *switches;
                bench.input.f_s = *f_s;
                let output = bench.at(*q);
                if !switches.deadman {
                    prop_assert_eq!(output.command, Motion::Hold);
                    prop_assert_eq!(output.tau, output.ledger.gravity);
                }
            }
        }
    }

    #[test]
    fn property_06_and_09_any_input_gives_finite_bounded_output(
        cycles in prop::collection::vec(
            (
                prop::array::uniform6(any::<i32>()),
                prop::array::uniform6(any_float()),
                any_pose(),
                switches(),
                mode(),
                [any_float(), any_float()],
                any::<bool>(),
            ),
            1..8,
        )
    ) {
        for settings in [settings(), by_rotation_vector(), everything(), as_printed()] {
            let mut controller = Controller::new(&settings);
            for (counts, f_s, x_b_m, switches, mode, [gravity, reflection], restart) in &cycles {
                let input = Input {
                    counts: counts.map(Counts),
                    f_s: Wrench::from_components(*f_s),
                    x_b_m: *x_b_m,
                    switches: *switches,
                    mode: *mode,
                    gravity_share: *gravity,
                    reflection_share: *reflection,
                    hold: false,
                    held: None,
                    restart: *restart,
                };
                let output = controller.step(&input);
                for (torque, max) in output.tau.iter().zip(MAX_TORQUES) {
                    prop_assert!(torque.abs() <= max);
                }
                let is_finite = match output.command {
                    Motion::Hold => true,
                    Motion::Rate(v_m) => v_m.is_finite(),
                    Motion::Pose(x) => x.to_homogeneous().iter().all(|entry| entry.is_finite()),
                };
                prop_assert!(is_finite, "{:?}", output.command);
                if !input.f_s.is_finite() {
                    prop_assert!(output.invalid_value.is_some());
                    // The virtual coupling does not use the sensor.
                    let is_sensed = settings.extensions.virtual_coupling.is_none();
                    prop_assert!(!is_sensed || output.f_g_task == Wrench::ZERO);
                }
                if !(0.0..=1.0).contains(gravity) {
                    prop_assert!(output.invalid_value.is_some());
                    prop_assert_eq!(output.ledger.gravity, JointVector::zeros());
                }
            }
        }
    }

    #[test]
    fn equal_inputs_give_equal_outputs(
        path in prop::collection::vec((joints(), switches(), wrench(50.0)), 1..10), mode in mode()
    ) {
        let run = || {
            let mut bench = Bench::new(&settings(), mode);
            path.iter().map(|(q, switches, f_s)| {
                bench.input.switches = *switches;
                bench.input.f_s = *f_s;
                bench.at(*q)
            }).collect::<Vec<_>>()
        };
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn hazard_40_and_property_05_reference_in_motion_zeroes_rate(q in joints(), by in -3e-3..3e-3_f64) {
        let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
        bench.at(q);
        let kept = bench.controller;
        let moved = q.map(|q| q + by);
        let undisturbed = bench.at(moved);
        bench.controller = kept;
        bench.input.switches = REFERENCE;
        let output = bench.at(moved);
        prop_assert_eq!(output.command, Motion::Rate(Twist::ZERO));
        for (ours, before) in
            output.f_g_damping.components().iter().zip(undisturbed.f_g_damping.components())
        {
            prop_assert!((ours - before).abs() < 1e-9);
        }
    }

    #[test]
    fn deadman_pressed_elsewhere_moves_no_object(q in joints(), mode in mode()) {
        let mut bench = Bench::engaged(&settings(), mode);
        bench.press(UP);
        bench.input.x_b_m = Isometry3::translation(0.5, 0.1, 0.2);
        bench.at(q);
        let output = bench.press(DEADMAN);
        match output.command {
            Motion::Pose(x_b_d) => {
                prop_assert!((x_b_d.inverse() * bench.input.x_b_m).translation.vector.norm() < 1e-12);
            }
            Motion::Rate(v_m) => prop_assert_eq!(v_m, Twist::ZERO),
            Motion::Hold => prop_assert_eq!(output.gate, Gate::Waiting),
        }
    }

    #[test]
    fn mode_change_moves_no_object(q in joints(), mode in mode()) {
        let mut bench = Bench::engaged(&settings(), mode);
        bench.at(q);
        bench.input.mode = match mode {
            CommandMode::Rate => CommandMode::Pose,
            CommandMode::Pose => CommandMode::Rate,
        };
        match bench.at(q).command {
            Motion::Pose(x_b_d) => {
                prop_assert!((x_b_d.inverse() * bench.input.x_b_m).translation.vector.norm() < 1e-12);
            }
            Motion::Rate(v_m) => prop_assert_eq!(v_m, Twist::ZERO),
            Motion::Hold => {}
        }
    }

    #[test]
    fn hazard_40_switches_and_modes_never_step_command_or_torque(
        steps in prop::collection::vec((switches(), mode(), 1..6_usize), 1..25),
        slow in prop::array::uniform6(-0.2..0.2_f64),
        f_s in wrench(15.0),
    ) {
        // The hand moves slowly and steadily and the object follows without delay, so steps are errors.
        let settings = everything();
        let mut bench = Bench::new(&settings, CommandMode::Rate);
        bench.input.f_s = f_s;
        let mut q = NEUTRAL;
        let (mut tau_before, mut command_before) = (None::<JointVector>, Motion::Hold);
        for (switches, mode, cycles) in steps {
            (bench.input.switches, bench.input.mode) = (switches, mode);
            for _ in 0..cycles {
                for (q, qd) in q.iter_mut().zip(slow) {
                    *q += qd * PERIOD;
                }
                let output = bench.at(q);
                if let Some(tau_before) = tau_before.replace(output.tau) {
                    for ((now, before), max) in output.tau.iter().zip(&tau_before).zip(MAX_TORQUES) {
                        // The slew limit: full capacity in 20 ms, a twentieth of it per cycle.
                        prop_assert!((now - before).abs() <= max * PERIOD / 0.02 + 1e-9);
                    }
                }
                match (&output.command, &command_before) {
                    (Motion::Pose(x_b_d), _) => {
                        let moved = bench.input.x_b_m.inverse() * x_b_d;
                        prop_assert!(moved.translation.vector.norm() < 2e-3, "the object jumps");
                        prop_assert!(moved.rotation.angle() < 4e-3, "the orientation jumps");
                        bench.input.x_b_m = *x_b_d;
                    }
                    (Motion::Rate(v_m), Motion::Hold | Motion::Pose(_)) => {
                        prop_assert!(v_m.linear.norm() < 1e-2, "the object starts at {v_m:?}");
                        bench.input.x_b_m *= v_m.over(PERIOD);
                    }
                    (Motion::Rate(v_m), Motion::Rate(before)) => {
                        let is_set = switches.reference;
                        let change = (v_m.linear - before.linear).norm();
                        prop_assert!(is_set || change < 1e-2, "the rate jumps by {change} m/s");
                        bench.input.x_b_m *= v_m.over(PERIOD);
                    }
                    (Motion::Hold, _) => {}
                }
                command_before = output.command;
            }
        }
    }

    #[test]
    fn ledger_terms_sum_to_the_torque(q in joints(), by in -1e-3..1e-3_f64, f_s in wrench(10.0), mode in mode()) {
        let settings = Settings { extensions: Extensions { slew: None, ..everything().extensions }, ..everything() };
        let mut bench = Bench::engaged(&settings, mode);
        bench.input.f_s = f_s;
        bench.at(q);
        let output = bench.at(q.map(|q| q + by));
        let ledger = &output.ledger;
        let assist = (ledger.centring + ledger.damping) * ledger.assist_scale;
        let rest = ledger.task + ledger.passivity + ledger.soft_stops + ledger.friction + assist;
        let tau = ledger.gravity + rest * (ledger.rest_scale * ledger.share);
        prop_assert!((output.tau - tau).norm() < 1e-9);
        prop_assert_eq!(ledger.limiting_joint.is_some(), ledger.rest_scale < 1.0);
    }

    #[test]
    fn torques_superpose_over_the_wrenches(
        q in joints(), by in -1e-4..1e-4_f64, f_s in wrench(0.5)
    ) {
        // Inputs below every limit: each source adds the virtual work of its wrench.
        let torques = |f_s: Wrench, damping: f64, gravity_share: f64| {
            let gains = Gains::new([damping, damping, damping, 0.0, 0.0, 0.0], "gain").unwrap();
            let settings = Settings { damping: gains, ..settings() };
            let mut bench = Bench::engaged(&settings, CommandMode::Rate);
            (bench.input.f_s, bench.input.gravity_share) = (f_s, gravity_share);
            bench.at(q);
            bench.at(q.map(|q| q + by))
        };
        let virtual_work = |output: &Output, f_g: &Wrench| {
            let twist = |joint: usize| {
                let mut qd = JointVector::zeros();
                qd[joint] = 1.0;
                output.j_g.twist(&qd)
            };
            JointVector::from([0, 1, 2, 3, 4, 5].map(|joint| f_g.power(&twist(joint))))
        };
        let none = torques(Wrench::ZERO, 0.0, 0.0);
        let felt = torques(f_s, 0.0, 0.0);
        prop_assume!([&none, &felt].iter().all(|output| output.ledger.limiting_joint.is_none()));
        prop_assume!([&none, &felt].iter().all(|output| output.ledger.assist_scale >= 1.0));
        prop_assert!((felt.tau - none.tau - virtual_work(&felt, &felt.f_g_task)).norm() < 1e-9);
        let damped = torques(Wrench::ZERO, 0.1, 0.0);
        prop_assume!(damped.ledger.limiting_joint.is_none() && damped.ledger.assist_scale >= 1.0);
        prop_assert!((damped.tau - none.tau - virtual_work(&damped, &damped.f_g_damping)).norm() < 1e-9);
        let carried = torques(Wrench::ZERO, 0.0, 1.0);
        prop_assume!(carried.ledger.limiting_joint.is_none() && carried.ledger.assist_scale >= 1.0);
        let weight = settings().arm.gravity(&settings().arm.posture(&carried.q));
        prop_assert!((carried.tau - none.tau - weight).norm() < 1e-9);
    }

    #[test]
    fn half_the_reflection_share_halves_the_felt_torque(q in joints(), f_s in wrench(50.0)) {
        let felt = |share: f64| {
            let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
            bench.input.f_s = f_s;
            bench.input.reflection_share = share;
            let output = bench.at(q);
            output.tau - output.ledger.gravity
        };
        prop_assert!((felt(1.0) - felt(0.5) * 2.0).norm() < 1e-9);
        prop_assert!(felt(0.0).norm() == 0.0);
    }
}
