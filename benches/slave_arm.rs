//! Benchmark of a slave arm: contact of two pegs with a plate, by how many points touch, and a step of 250 µs.
//!
//! `cargo bench --bench slave_arm` prints the mean time of an evaluation, and the number of points in contact.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "a benchmark prints, and cannot go on without what it needs"
)]

use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant as Clock;

use nalgebra::{Isometry3, Matrix3, Vector3};

use sim::arm::{LinkSettings, Load};
use sim::contact::{Contact, Holes, Pegs, Plate, Scene, Shape, Surface};
use sim::manipulator::{JointSettings, MAX_STEP, Manipulator, ManipulatorSettings, Tool};
use sim::wrist_sensor::WristSensorSettings;
use units::spatial::Twist;

/// Number of evaluations per mean.
const COUNT: u32 = 200_000;

fn main() {
    for (name, offset, tilt) in [
        ("above the plate", [0.0, 0.0, 0.01], 0.0),
        ("in the holes without contact", [0.0, 0.0, -0.01], 0.0),
        ("flat on the face", [0.0, 0.02, -1e-4], 0.0),
        ("on the chamfers", [1.2e-3, 0.0, -0.5e-3], 0.0),
        ("pressed against the bores", [0.25e-3, 0.0, -0.012], 0.0),
        ("tilted in the holes", [0.0, 0.0, -0.012], 0.05),
    ] {
        contact(name, offset, tilt);
    }
    arm();
}

fn pegs() -> Pegs {
    Pegs {
        x_m_t: Isometry3::identity(),
        count: 2,
        radius: 5e-3,
        length: 0.03,
        spacing: 0.04,
        chamfer_width: 0.0,
        chamfer_length: 0.0,
    }
}

fn plate(x_b_p: Isometry3<f64>) -> Plate {
    let (chamfer_width, chamfer_depth) = (1.5e-3, 1.5e-3);
    Plate {
        x_b_p,
        half_size: [0.06, 0.04],
        thickness: 0.02,
        holes: Holes { count: 2, radius: 5.2e-3, spacing: 0.04, chamfer_width, chamfer_depth },
        surface: Surface { stiffness: 1e5, damping: 200.0, damping_depth: 1e-4, friction: 0.3 },
    }
}

/// Prints the time of an evaluation with the ends of the pegs at `offset` from the middle of the holes.
fn contact(name: &str, offset: [f64; 3], tilt: f64) {
    let scene = Scene { plate: Some(plate(Isometry3::identity())), ..Scene::default() };
    let mut contact = Contact::new(Shape::Pegs(pegs()), scene).unwrap();
    let x_p_e =
        Isometry3::new(offset.into(), Vector3::y() * tilt) * Isometry3::rotation(Vector3::x() * PI);
    let x_b_m = x_p_e * pegs().x_m_e().inverse();
    let v_m = Twist::from_components([0.01, 0.0, 0.02, 0.0, 0.1, 0.0]);
    let begin = Clock::now();
    for _ in 0..COUNT {
        black_box(contact.wrench(black_box(&x_b_m), &v_m));
    }
    let mean = begin.elapsed().as_secs_f64() * 1e6 / f64::from(COUNT);
    println!("contact, {name}: {mean:.2} µs, {:?}", contact.features());
}

/// Prints the time of a step of an arm of eight joints, with a plate out of reach.
fn arm() {
    let link = |alpha: f64, a: f64, d: f64| LinkSettings {
        is_prismatic: false,
        alpha,
        a,
        d,
        theta: 0.0,
        mass: 2.0,
        centre_of_mass: Vector3::new(0.0, 0.02, 0.08),
        inertia: Matrix3::from_diagonal_element(0.01),
        rotor_inertia: 0.1,
    };
    let links = [
        (0.0, 0.3),
        (-1.5, 0.0),
        (1.5, 0.4),
        (-1.5, 0.0),
        (1.5, 0.4),
        (-1.5, 0.0),
        (1.5, 0.1),
        (-1.5, 0.1),
    ];
    let joint = |(alpha, d)| JointSettings {
        link: link(alpha, 0.0, d),
        start: 0.4,
        coulomb: 0.5,
        viscous: 0.2,
        max_torque: 100.0,
    };
    let settings = ManipulatorSettings {
        joints: links.into_iter().map(joint).collect(),
        x_b_0: Isometry3::identity(),
        x_n_m: Isometry3::identity(),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        servo_time_constant: 0.02,
        sensor: WristSensorSettings::IDEAL,
        seed: 1,
    };
    let tool = Tool {
        shape: Shape::Pegs(pegs()),
        x_m_s: Isometry3::identity(),
        load: Load {
            mass: 1.0,
            centre_of_mass: Vector3::z() * 0.02,
            inertia: Matrix3::from_diagonal_element(1e-3),
        },
    };
    let far = plate(Isometry3::translation(0.0, 0.0, -5.0));
    let scene = Scene { plate: Some(far), ..Scene::default() };
    let mut arm = Manipulator::new(&settings, tool, scene).unwrap();
    let begin = Clock::now();
    for step in 0..COUNT {
        let rate = if step / 500 % 2 == 0 { 0.3 } else { -0.3 };
        arm.step(MAX_STEP, &[rate; 9]);
    }
    black_box(arm.q());
    let mean = begin.elapsed().as_secs_f64() * 1e6 / f64::from(COUNT);
    println!("arm of 8 joints, a step of 250 µs: {mean:.2} µs");
}
