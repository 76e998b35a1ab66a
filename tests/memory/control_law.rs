//! Properties of a controller cycle for any joints, wrench and switches: power is conserved, outputs are continuous,
//! no motion is uncommanded, and invalid inputs have no effect.
#![cfg(test)]

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::common::{bench, oracle};
use controller::arm::{Arm, JointKind, Link};
use controller::assist::ContactFade;
use controller::calibration::{Calibration, JointCalibration, TorqueCurve};
use controller::channels::Channels;
use controller::command::{CommandLaw, Gate};
use controller::engagement::Engagement;
use controller::friction::{FrictionCompensation, FrictionSettings};
use controller::gains::Gains;
use controller::interpretation::Interpretation;
use controller::limits::{AssistFraction, Slew};
use controller::orientation::Orientation;
use controller::passivity::{Passivity, PassivitySettings};
use controller::period::Period;
use controller::reflection::Reflection;
use controller::soft_stops::SoftStops;
use controller::switches::{CommandMode, Switches};
use controller::tank::{Tank, TankSettings};
use controller::velocity::Filter;
use controller::virtual_coupling::VirtualCoupling;
use controller::{
    Controller, DriveTargets, Extensions, Input, InvalidValue, JointVector, Output, Settings,
};
use units::drive::{Counts, PerMille};
use units::spatial::{Motion, Twist, Wrench};

const NEUTRAL: [f64; 6] = [0.1, -0.87, 1.66, -0.79, 0.1, 0.2];
const MAX_TORQUES: [f64; 6] = [6.0, 6.0, 4.0, 1.2, 1.0, 0.8];
const PERIOD: f64 = 1e-3;

const UP: Switches = Switches { deadman: false, reference: false, reflection: false };
const DEADMAN: Switches = Switches { deadman: true, ..UP };
const REFERENCE: Switches = Switches { reference: true, ..DEADMAN };
const REFLECTION: Switches = Switches { reflection: true, ..DEADMAN };

fn settings() -> Settings {
    let gains = |values| Gains::new(values, "gain").unwrap();
    let curve = |max_torque| TorqueCurve::new([150.0, 1.0, 0.01], max_torque).unwrap();
    // One count is about 1e-9 rad, below any tolerance here.
    let joint = |max_torque| {
        let ratio = 1e5 * std::f64::consts::TAU;
        JointCalibration::new(10_000, ratio, -5, curve(max_torque)).unwrap()
    };
    Settings {
        interpretation: Interpretation::CONSISTENT,
        period: Period::new(PERIOD).unwrap(),
        arm: oracle::arm("kraft_like"),
        calibration: Calibration::new(MAX_TORQUES.map(joint)),
        channels: Channels::new(
            [0.01, 0.01, 0.01, 0.06, 0.06, 0.06],
            [2.0, 2.0, 2.0, 0.08, 0.08, 0.08],
        )
        .unwrap(),
        command: CommandLaw {
            rate_gain: gains([2.0, 2.0, 2.0, 1.5, 1.5, 1.5]),
            pose_gain: gains([1.0; 6]),
            pose_deadband: false,
        },
        reflection: Reflection::new(
            Isometry3::translation(0.0, 0.0, -0.05),
            gains([1.0; 6]),
            1e3,
            1e3,
        )
        .unwrap(),
        damping: gains([8.0, 8.0, 8.0, 0.02, 0.02, 0.02]),
        assist_fraction: AssistFraction::new(0.35).unwrap(),
        bounds: controller::adjustment::Bounds::FIXED,
        extensions: Extensions::default(),
    }
}

fn by_rotation_vector() -> Settings {
    let orientation = Orientation::RotationVector;
    Settings {
        interpretation: Interpretation { orientation, ..Interpretation::CONSISTENT },
        ..settings()
    }
}

fn as_printed() -> Settings {
    Settings { interpretation: Interpretation::PAPER_1997, ..settings() }
}

/// Returns settings with every optional layer, tuned so that each acts.
fn everything() -> Settings {
    let plain = settings();
    let gains = |linear, angular| {
        Gains::new([linear, linear, linear, angular, angular, angular], "gain").unwrap()
    };
    let max_torques = plain.calibration.max_torques();
    let extensions = Extensions {
        velocity_filter: Filter::new(0.005).unwrap(),
        walls_in_pose: true,
        contact_fade: Some(ContactFade::new(5.0).unwrap()),
        damping_never_pulls: true,
        engagement: Some(Engagement::new(0.05, None, plain.period).unwrap()),
        soft_stops: Some(SoftStops::new(plain.arm.ranges(), &max_torques, 0.1, 0.5).unwrap()),
        friction: Some(
            FrictionCompensation::new(FrictionSettings {
                share: 0.7,
                coulomb: max_torques * 0.01,
                viscous: max_torques * 0.004,
                presliding: JointVector::repeat(1e-3),
            })
            .unwrap(),
        ),
        slew: Some(Slew::new(&max_torques, 0.02, plain.period).unwrap()),
        passivity: Some(
            Passivity::new(PassivitySettings {
                max_energy: 0.05,
                max_damping: 20.0,
                lever: 0.1,
                contact_threshold: 0.1,
                contact_release_cycles: 500,
                is_one_sided: true,
            })
            .unwrap(),
        ),
        tank: Some(
            Tank::new(TankSettings {
                initial: 0.1,
                min: 0.0,
                low: 0.02,
                max: 0.5,
                refill: 50.0,
                max_damping: 60.0,
            })
            .unwrap(),
        ),
        virtual_coupling: Some(VirtualCoupling::new(
            gains(400.0, 5.0),
            gains(2.0, 0.02),
            plain.period,
        )),
    };
    let channels = plain.channels.with_wall([0.1; 6], [200.0; 6]).unwrap();
    Settings { extensions, channels, ..plain }
}

/// A controller and its input.
struct Bench {
    controller: Controller,
    calibration: Calibration<6>,
    input: Input,
}

impl Bench {
    /// Creates a controller and runs one cycle with all switches open.
    fn new(settings: &Settings, mode: CommandMode) -> Self {
        let mut bench = Self {
            controller: Controller::new(settings),
            calibration: settings.calibration,
            input: Input {
                counts: settings.calibration.counts(&JointVector::from(NEUTRAL)),
                f_s: Wrench::ZERO,
                x_b_m: Isometry3::translation(0.4, 0.0, 0.3),
                switches: UP,
                mode,
                gravity_share: 1.0,
                reflection_share: 1.0,
                held: None,
                restart: true,
            },
        };
        bench.press(UP);
        bench.input.restart = false;
        bench
    }

    /// Creates a controller with the deadman held, the reference set at the neutral posture, and reflection on.
    fn engaged(settings: &Settings, mode: CommandMode) -> Self {
        let mut bench = Self::new(settings, mode);
        bench.press(REFLECTION);
        bench.press(REFERENCE);
        bench.press(DEADMAN);
        bench
    }

    fn press(&mut self, switches: Switches) -> Output {
        self.input.switches = switches;
        self.controller.step(&self.input)
    }

    fn at(&mut self, q: [f64; 6]) -> Output {
        self.input.counts = self.calibration.counts(&JointVector::from(q));
        self.controller.step(&self.input)
    }
}

#[test]
fn torques_rise_from_zero_where_targets_are_withdrawn() {
    let after = |held| {
        let mut bench =
            Bench::engaged(&bench::config("config/kraft_like.toml").controller, CommandMode::Rate);
        (0..2_000).for_each(|_| _ = bench.press(DEADMAN));
        bench.input.held = held;
        bench.press(DEADMAN).tau.norm()
    };
    let carried = after(None);
    let zeros = after(Some(DriveTargets::Sent([PerMille(0); 6])));
    assert!(
        (zeros - carried).abs() < 1e-3 * carried,
        "six zeros that were sent: {zeros} {carried}"
    );
    let withdrawn = after(Some(DriveTargets::Withdrawn));
    assert!(withdrawn < 0.5 * carried, "{withdrawn} {carried}");
}

fn displaced(by: f64) -> [f64; 6] {
    NEUTRAL.map(|q| q + by)
}

fn joints() -> impl Strategy<Value = [f64; 6]> {
    prop::array::uniform6(-0.3..0.3_f64)
        .prop_map(|by| [0, 1, 2, 3, 4, 5].map(|joint| NEUTRAL[joint] + by[joint]))
}

fn wrench(size: f64) -> impl Strategy<Value = Wrench> {
    prop::array::uniform6(-size..size).prop_map(Wrench::from_components)
}

fn mode() -> impl Strategy<Value = CommandMode> {
    prop_oneof![Just(CommandMode::Rate), Just(CommandMode::Pose)]
}

fn switches() -> impl Strategy<Value = Switches> {
    any::<[bool; 3]>().prop_map(|[deadman, reference, reflection]| Switches {
        deadman,
        reference,
        reflection,
    })
}

/// Generates any 64-bit float, with infinities, NaN, subnormals and the ends of the range more often.
fn any_float() -> impl Strategy<Value = f64> {
    let edges = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MIN_POSITIVE / 2.0,
        1e308,
        -1e308,
        -0.0,
        1e5,
    ];
    prop_oneof![prop::num::f64::ANY, prop::sample::select(edges.to_vec()), -1e6..1e6_f64]
}

fn any_pose() -> impl Strategy<Value = Isometry3<f64>> {
    prop::array::uniform7(any_float()).prop_map(|[x, y, z, w, i, j, k]| {
        let rotation = nalgebra::Quaternion::new(w, i, j, k);
        Isometry3::from_parts(Vector3::new(x, y, z).into(), UnitQuaternion::new_unchecked(rotation))
    })
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

#[test]
fn hazard_42_invalid_wrench_has_no_effect() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    for (part, invalid) in [
        (f64::NAN, InvalidValue::WrenchNotFinite),
        (f64::NEG_INFINITY, InvalidValue::WrenchNotFinite),
        (1e6, InvalidValue::WrenchTooLarge),
    ] {
        bench.input.f_s = Wrench::from_components([0.0, part, 0.0, 0.0, 0.0, 0.0]);
        let output = bench.at(NEUTRAL);
        assert_eq!(output.invalid_value, Some(invalid));
        assert!((output.tau - output.ledger.gravity).norm() < 1e-12);
    }
}

#[test]
fn invalid_object_pose_keeps_the_last_pose() {
    let mut bench = Bench::new(&settings(), CommandMode::Pose);
    bench.input.x_b_m = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let output = bench.press(DEADMAN);
    assert_eq!(output.invalid_value, Some(InvalidValue::ObjectPoseNotFinite));
    let Motion::Pose(x_b_d) = output.command else { panic!("{:?}", output.command) };
    assert!((x_b_d.translation.vector - Vector3::new(0.4, 0.0, 0.3)).norm() < 1e-12);
}

#[test]
fn displaced_hand_commands_no_rate_until_back_at_centre() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    bench.press(UP);
    bench.at(displaced(0.1));
    assert_eq!(bench.press(DEADMAN).command, Motion::Hold);
    assert_eq!(bench.at(displaced(0.12)).command, Motion::Hold);
    assert_eq!(bench.at(NEUTRAL).command, Motion::Rate(Twist::ZERO));
    let Motion::Rate(v_m) = bench.at(displaced(0.1)).command else { panic!("held") };
    assert!(v_m.linear.norm() > 0.0);
}

#[test]
fn hand_turned_past_80_degrees_holds_until_back_at_centre() {
    let mut settings = settings();
    // Five prismatic joints and one revolute joint that rotates the grip about y, the axis of β.
    settings.arm = {
        let links = [JointKind::Prismatic; 5].map(|kind| Link {
            kind,
            range: [-1.0, 1.0],
            ..Link::TURNING
        });
        let [a, b, c, d, e] = links;
        let alpha = -std::f64::consts::FRAC_PI_2; // its z axis is y of {0}
        let wrist = Link { kind: JointKind::Revolute, alpha, ..a };
        let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -alpha);
        let x_6_g = Isometry3::from_parts(Vector3::zeros().into(), upright);
        Arm::new([a, b, c, d, e, wrist], x_6_g, [0.0; 3]).unwrap()
    };
    let rotated = |degrees: f64| [0.0, 0.0, 0.0, 0.0, 0.0, degrees.to_radians()];
    let mut bench = Bench::new(&settings, CommandMode::Rate);
    bench.at(rotated(0.0));
    bench.press(REFERENCE);
    bench.press(DEADMAN);
    assert_eq!(bench.at(rotated(79.0)).invalid_value, None);
    for degrees in [81.0, 89.0, 95.0, 79.0] {
        let output = bench.at(rotated(degrees));
        assert_eq!(
            (output.command, output.invalid_value),
            (Motion::Hold, Some(InvalidValue::TurnedTooFar))
        );
    }
    assert_eq!(bench.at(rotated(0.0)).invalid_value, None);
    assert!(matches!(bench.at(rotated(20.0)).command, Motion::Rate(v_m) if v_m.angular.y > 0.1));
}

#[test]
fn first_deadman_press_sets_the_reference() {
    let mut bench = Bench::new(&settings(), CommandMode::Rate);
    bench.at(displaced(0.1));
    let output = bench.press(DEADMAN);
    assert!(output.reference.is_set);
    assert_eq!(output.command, Motion::Rate(Twist::ZERO));
}

#[test]
fn restart_suspends_damping_for_one_cycle() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    bench.input.restart = true;
    assert!(bench.at(displaced(0.2)).f_g_damping.force.norm() == 0.0);
    bench.input.restart = false;
    assert!(bench.at(displaced(0.201)).f_g_damping.force.norm() > 0.0);
}

#[test]
fn hazard_44_large_wrench_saturates_and_names_the_joint() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Rate);
    bench.input.f_s = Wrench::from_components([300.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let output = bench.at(NEUTRAL);
    let joint = output.ledger.limiting_joint.unwrap().index();
    assert!(output.is_saturated() && output.ledger.rest_scale < 1.0);
    assert!((output.tau[joint].abs() - MAX_TORQUES[joint]).abs() < 1e-12);
}

#[test]
fn index_button_keeps_the_last_command_of_a_lagging_object() {
    let mut bench = Bench::engaged(&settings(), CommandMode::Pose);
    let asked = bench.at(displaced(0.05)).command;
    assert!(asked != Motion::Pose(bench.input.x_b_m), "the object lags behind");
    bench.press(REFERENCE);
    for by in [0.05, 0.0, -0.05] {
        let (Motion::Pose(kept), Motion::Pose(asked)) = (bench.at(displaced(by)).command, asked)
        else {
            panic!("no pose commanded");
        };
        assert!((kept.to_homogeneous() - asked.to_homogeneous()).norm() < 1e-12);
    }
}
