//! PUMA 560 of Corke, and an 8R arm, in free motion and in contact.

use nalgebra::{Matrix3, Unit};
use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::contact::{HALF_CUBE, Holes, Pegs, Plate, Surface, Wall};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const RIGID: Surface =
    Surface { stiffness: 1e5, damping: 300.0, damping_depth: 1e-3, friction: 0.3 };

/// Returns the PUMA 560 with its motors' inertia; friction and torque from the data of Corke.
fn puma() -> ManipulatorSettings {
    let text = include_str!("../../../../tests/oracles/puma560_corke_mdh.json");
    let oracle: Value = serde_json::from_str(text).unwrap();
    let start = [0.0, 0.8, -2.2, 0.0, 1.4, 0.0];
    let coulomb = [6.3, 5.5, 2.6, 1.3, 1.0, 1.2];
    let max_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3];
    let links = crate::arm::tests::links(&oracle["model"]);
    let joint = |place: usize| JointSettings {
        link: links[place],
        start: start[place],
        coulomb: coulomb[place],
        viscous: 0.5 * coulomb[place],
        max_torque: max_torque[place],
    };
    settings((0..6).map(joint).collect(), 0.1)
}

/// Returns an arm of eight revolute joints with direct drives: small rotors, and strong coupling between joints.
fn eight_r() -> ManipulatorSettings {
    let table = [
        (0.0, 0.0, 0.34),
        (-1.57, 0.0, 0.0),
        (1.57, 0.0, 0.4),
        (-1.57, 0.0, 0.0),
        (1.57, 0.0, 0.39),
        (-1.57, 0.0, 0.0),
        (1.57, 0.08, 0.0),
        (-1.57, 0.0, 0.1),
    ];
    let start = [0.1, 0.6, 0.2, -1.5, 0.3, 1.1, 0.4, 0.2];
    let masses = [4.0, 4.0, 3.5, 3.0, 2.5, 1.5, 1.0, 0.4];
    let joint = |place: usize| {
        let (alpha, a, d): (f64, f64, f64) = table[place];
        let mass = masses[place];
        JointSettings {
            link: LinkSettings {
                is_prismatic: false,
                alpha,
                a,
                d,
                theta: 0.0,
                mass,
                centre_of_mass: Vector3::new(0.0, 0.02, 0.08),
                inertia: Matrix3::from_diagonal_element(mass * 4e-3),
                rotor_inertia: 2e-3,
            },
            start: start[place],
            coulomb: 0.2,
            viscous: 0.1,
            max_torque: 150.0,
        }
    };
    settings((0..8).map(joint).collect(), 0.05)
}

fn settings(joints: Vec<JointSettings>, reach: f64) -> ManipulatorSettings {
    ManipulatorSettings {
        joints,
        x_b_0: Isometry3::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.0, 0.0, 0.7)),
        x_n_m: Isometry3::translation(0.0, 0.0, reach),
        gravity: GRAVITY,
        servo_time_constant: 0.02,
        sensor: WristSensorSettings::IDEAL,
        seed: 1,
    }
}

fn tool() -> Tool {
    Tool {
        shape: Shape::Cube { half_edge: HALF_CUBE },
        x_m_s: Isometry3::new(Vector3::new(0.0, 0.01, -0.06), Vector3::new(0.3, 0.0, 0.2)),
        load: Load {
            mass: 1.2,
            centre_of_mass: Vector3::new(0.005, 0.0, 0.03),
            inertia: Matrix3::from_diagonal(&Vector3::new(1e-3, 1.2e-3, 8e-4)),
        },
    }
}

fn start(settings: &ManipulatorSettings, scene: Scene) -> Manipulator {
    Manipulator::new(settings, tool(), scene).unwrap()
}

/// Returns a wall below the tool, at `gap` m from the lowest corner of its cube.
fn wall_below(arm: &Manipulator, gap: f64, surface: Surface) -> Scene {
    let corner = |sign: [f64; 3]| Vector3::from(sign) * HALF_CUBE;
    let corners = (0..8).map(|bits| {
        let side = |bit: i32| if bits >> bit & 1 == 0 { -1.0 } else { 1.0 };
        (arm.x_b_m() * nalgebra::Point3::from(corner([side(0), side(1), side(2)]))).coords
    });
    let lowest = corners.min_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    let point = lowest - Vector3::z() * gap;
    Scene {
        wall: Some(Wall { point, normal: Unit::new_normalize(Vector3::z()), surface }),
        ..Scene::default()
    }
}

/// Returns joint rates for a twist of {M}, by the transpose of a damped pseudo-inverse.
fn rates(arm: &Manipulator, v_m: &Twist) -> [f64; 9] {
    let j_m = arm.j_m.matrix();
    let square = j_m * j_m.transpose() + nalgebra::SMatrix::<f64, 6, 6>::identity() * 1e-6;
    let v_m = nalgebra::SVector::<f64, 6>::from(v_m.components());
    (j_m.transpose() * square.cholesky().unwrap().solve(&v_m)).into()
}

#[test]
fn joint_rates_lag_by_the_servo_time_constant() {
    for settings in [puma(), eight_r()] {
        let free: Vec<JointSettings> =
            settings.joints.iter().map(|joint| JointSettings { coulomb: 0.0, ..*joint }).collect();
        let mut arm = start(&ManipulatorSettings { joints: free, ..settings }, Scene::default());
        let wanted = [0.2, -0.1, 0.15, -0.2, 0.1, 0.2, -0.1, 0.15, 0.0];
        for step in 1..=60_u16 {
            arm.step(2e-3, &wanted);
            let share = -(-f64::from(step) * 2e-3 / 0.02).exp_m1();
            for (qd, wanted) in arm.qd().iter().zip(wanted).take(arm.joint_count()) {
                assert!(
                    (qd - wanted * share).abs() < 0.004,
                    "{step}: {qd} is not {}",
                    wanted * share
                );
            }
        }
    }
}

#[test]
fn arm_at_rest_does_not_sag_and_its_padding_does_not_move() {
    for settings in [puma(), eight_r()] {
        let mut arm = start(&settings, Scene::default());
        let before = arm.q;
        for _ in 0..500 {
            arm.step(2e-3, &[0.0; 9]);
        }
        assert_eq!(arm.q, before);
        let mut pushed = [0.0; 9];
        pushed[8] = 1.0;
        arm.step(2e-3, &pushed);
        assert_eq!(arm.q, before);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn friction_adds_no_energy(qd in prop::array::uniform8(-1.5..1.5_f64)) {
        // Without gravity and servo only friction is left.
        let joints = eight_r().joints.into_iter().map(|joint| JointSettings { coulomb: 4.0, max_torque: 1e-12, ..joint });
        let settings = ManipulatorSettings { joints: joints.collect(), gravity: Vector3::zeros(), ..eight_r() };
        let mut arm = start(&settings, Scene::default());
        arm.qd.fixed_rows_mut::<8>(0).copy_from_slice(&qd);
        let mut before = arm.energy();
        for _ in 0..4_000 {
            arm.step(1e-3, &[0.0; 9]);
            let after = arm.energy();
            prop_assert!(after <= before * 1.001 + 1e-12, "{} J appeared of {before}", after - before);
            before = after;
        }
        prop_assert!(arm.qd().iter().all(|qd| qd.abs() <= 0.0), "{:?}", arm.qd());
    }
}

#[test]
fn sensor_reads_weight_contact_and_inertia() {
    let mut arm = start(&puma(), Scene::default());
    let (load, x_b_s) = (tool().load, arm.x_b_m() * tool().x_m_s);
    let weight = x_b_s.rotation.inverse() * (GRAVITY * load.mass);
    let expected = Wrench { force: weight, moment: load.centre_of_mass.cross(&weight) };
    arm.step(2e-3, &[0.0; 9]);
    assert!((arm.f_s_true().force - expected.force).norm() < 1e-9, "{:?}", arm.f_s_true());
    assert!((arm.f_s_true().moment - expected.moment).norm() < 1e-9);
    assert_eq!(arm.f_s_true(), arm.f_s_sensed());

    // Momentum: the change of p is the impulse of gravity less that of the sensor's reading.
    let momentum = |arm: &Manipulator| {
        let v_c = arm.v_m().at(&(tool().x_m_s * Isometry3::from(load.centre_of_mass)).inverse());
        let r = arm.x_b_m().rotation * tool().x_m_s.rotation;
        let spin = r * (load.inertia * v_c.angular);
        (r * v_c.linear * load.mass, spin)
    };
    let mut largest = 0.0_f64;
    for step in 0..50 {
        let before = momentum(&arm);
        arm.step(1e-3, &[0.6, -0.5, 0.8, 1.0, -1.2, 1.5, 0.0, 0.0, 0.0]);
        let after = momentum(&arm);
        let x_b_s = arm.x_b_m() * tool().x_m_s;
        let of_arm = x_b_s.rotation * -arm.f_s_true().force;
        let needed = (after.0 - before.0) / 1e-3 - GRAVITY * load.mass;
        largest = largest.max((needed - GRAVITY * -load.mass).norm());
        assert!((of_arm - needed).norm() < 0.05, "{step}: {of_arm} is not {needed}");
    }
    assert!(largest > 5.0, "the load hardly accelerated: {largest} N");
}

#[test]
fn contact_is_sensed_with_its_sign_and_place() {
    let settings = puma();
    let scene = wall_below(&start(&settings, Scene::default()), 0.002, RIGID);
    let mut arm = start(&settings, scene);
    for _ in 0..400 {
        let down = arm.x_b_m().rotation.inverse() * Vector3::new(0.0, 0.0, -0.01);
        let qd = rates(&arm, &Twist { linear: down, angular: Vector3::zeros() });
        arm.step(2e-3, &qd);
        if arm.f_m_contact().force.norm() > 20.0 {
            break;
        }
    }
    let f_m = *arm.f_m_contact();
    let up = arm.x_b_m().rotation * f_m.force;
    assert!(up.z > 15.0, "{up}");
    let weight = arm.f_s_true().at(&tool().x_m_s) - f_m;
    assert!((weight.force.norm() - 1.2 * 9.81).abs() < 0.5, "{weight:?}");
}

#[test]
fn stiff_contact_of_both_arms_is_stable() {
    for (name, settings) in [("puma", puma()), ("8R", eight_r())] {
        for surface in [RIGID, Surface { damping: 0.0, friction: 0.0, ..RIGID }] {
            let scene = wall_below(&start(&settings, Scene::default()), 0.001, surface);
            let mut arm = start(&settings, scene);
            let down = arm.x_b_m().rotation.inverse() * Vector3::new(0.0, 0.0, -0.02);
            // Press, then stand still.
            while pressure(&arm) < 60.0 {
                let qd = rates(&arm, &Twist { linear: down, angular: Vector3::zeros() });
                arm.step(2e-3, &qd);
            }
            for _ in 0..500 {
                arm.step(2e-3, &[0.0; 9]);
            }
            let mut spread = [f64::INFINITY, 0.0_f64];
            for _ in 0..200 {
                arm.step(2e-3, &[0.0; 9]);
                let f = arm.f_m_contact().force.norm();
                spread = [spread[0].min(f), spread[1].max(f)];
            }
            assert!(spread[0] > 1.0, "{name} lost the wall: {spread:?} N");
            assert!(spread[1] - spread[0] < 0.5, "{name} with {surface:?}: {spread:?} N");
        }
    }
}

/// Returns the upward force of the scene on the tool, in N.
fn pressure(arm: &Manipulator) -> f64 {
    (arm.x_b_m().rotation * arm.f_m_contact().force).z
}

#[test]
fn arms_insert_two_pegs_with_force_accommodation() {
    let pegs = Pegs {
        x_m_t: Isometry3::identity(),
        count: 2,
        radius: 5e-3,
        length: 0.04,
        spacing: 0.04,
        chamfer_width: 5e-4,
        chamfer_length: 5e-4,
    };
    let holes =
        Holes { count: 2, radius: 5.2e-3, spacing: 0.04, chamfer_width: 2e-3, chamfer_depth: 2e-3 };
    for (name, settings) in [("puma", puma()), ("8R", eight_r())] {
        let tool = Tool { shape: Shape::Pegs(pegs), ..tool() };
        let x_b_m = *start(&settings, Scene::default()).x_b_m();
        // The plate is below the ends of the pegs by 3 mm, and displaced across by 1.2 mm.
        let x_p_e =
            Isometry3::new(Vector3::new(-1e-3, 0.7e-3, 3e-3), Vector3::x() * std::f64::consts::PI);
        let x_b_p = x_b_m * pegs.x_m_e() * x_p_e.inverse();
        let surface = Surface { friction: 0.2, damping_depth: 1e-4, ..RIGID };
        let plate = Plate { x_b_p, half_size: [0.06, 0.04], thickness: 0.05, holes, surface };
        let scene = Scene { plate: Some(plate), ..Scene::default() };
        let mut arm = Manipulator::new(&settings, tool, scene).unwrap();
        let mut highest = 0.0_f64;
        for _ in 0..3_000 {
            let f_m = arm.f_m_contact();
            let at_ends = f_m.at(&pegs.x_m_e().inverse());
            let v_e = Twist {
                linear: at_ends.force * 4e-4 + Vector3::new(0.0, 0.0, 0.008),
                angular: at_ends.moment * 0.03,
            };
            let qd = rates(&arm, &v_e.at(&pegs.x_m_e()));
            arm.step(2e-3, &qd);
            highest = highest.max(arm.f_m_contact().force.norm());
        }
        let x_b_m = *arm.x_b_m();
        for insertion in arm.contact().insertions(&x_b_m) {
            let depth = insertion.unwrap().depth;
            assert!(depth > 0.02, "{name}: {depth} m, {:?}", arm.contact().features());
        }
        assert!((5.0..80.0).contains(&highest), "{name}: {highest} N");
    }
}

#[test]
fn step_repeats_bit_for_bit_and_may_be_split() {
    let settings = eight_r();
    let scene = wall_below(&start(&settings, Scene::default()), 0.001, RIGID);
    let (mut whole, mut parts) = (start(&settings, scene), start(&settings, scene));
    let mut again = whole.clone();
    let qd = [0.1, 0.3, -0.2, 0.4, 0.1, -0.3, 0.2, 0.1, 0.0];
    for _ in 0..100 {
        whole.step(1e-3, &qd);
        again.step(1e-3, &qd);
        for _ in 0..4 {
            parts.step(MAX_STEP, &qd);
        }
    }
    assert_eq!((whole.q, whole.f_m_contact), (again.q, again.f_m_contact));
    let difference =
        whole.q().iter().zip(parts.q()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(difference < 1e-9, "{difference}");
}

#[test]
fn invalid_settings_are_refused_with_their_values() {
    let refused = |settings: &ManipulatorSettings| {
        Manipulator::new(settings, tool(), Scene::default()).unwrap_err().to_string()
    };
    let mut settings = puma();
    settings.joints = vec![settings.joints[0]; 10];
    assert_eq!(refused(&settings), "an arm must have 1 to 9 joints, got 10");
    let settings = ManipulatorSettings { servo_time_constant: 0.0, ..puma() };
    assert_eq!(refused(&settings), "servo_time_constant must be positive and finite, got 0");
    let mut settings = puma();
    settings.joints[2].coulomb = f64::NAN;
    assert_eq!(refused(&settings), "coulomb must be 0 or above and finite, got NaN");
}
