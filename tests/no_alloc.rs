//! No allocation in ten thousand cycles of node, controller, bus and simulation: without and with link delay, with a robot
//! in another process, and of a slave arm in contact.
#![allow(
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io::Read;
use std::sync::atomic::{AtomicU64, Ordering};

use common::bench::scenario;
use common::prelude::*;

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use socket2::{Domain, SockAddr, Socket, Type};

use config::RemoteLink;
use contract::FarEnd;
use remote::delay::DelaySettings;
use remote::link::{self, link};
use remote::stated::StatedCapability;
use remote::{Command, Remote, RemoteSample, messages};
use sim::arm::{LinkSettings, Load};
use sim::contact::{Scene, Shape, Surface, Wall};
use sim::manipulator::{JointSettings, Manipulator, ManipulatorSettings, Tool};
use sim::wrist_sensor::WristSensorSettings;

/// Counts allocations of the threads that set [`IS_COUNTED`]. The test harness has a thread of its own, which allocates
/// when a test takes longer than a minute.
struct CountingAllocator;

thread_local! {
    static IS_COUNTED: Cell<bool> = const { Cell::new(false) };
}
static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

#[expect(unsafe_code, reason = "a global allocator is unsafe by its trait; this one only counts")]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if IS_COUNTED.get() {
            ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        }
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise about `pointer` and `layout` is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Layers of the controller that are absent from the shipped configuration.
const MORE_LAYERS: &str = "[controller.tank]\ninitial_j = 0.1\nmin_j = 0.0\nlow_j = 0.02\nmax_j = 0.5\n\
    refill_ns_per_m_per_j = 100.0\n\n[controller.virtual_coupling]\n\
    stiffness_n_per_m = [400.0, 400.0, 400.0]\nstiffness_nm_per_rad = [2.0, 2.0, 2.0]\n\
    damping_ns_per_m = [2.0, 2.0, 2.0]\ndamping_nms_per_rad = [0.01, 0.01, 0.01]\n\n\
    [switches.gripper]\nopen_bit = 4\nclose_bit = 5\n\
    stroke_m = 0.08\nforce_n = 15.0\nmax_speed_m_per_s = 0.05\n\n\
    [remote.gripper]\nstroke_m = 0.08\nmax_speed_m_per_s = 0.1\n\n[remote]\n";

#[test]
fn ten_thousand_cycles_with_every_layer_never_allocate() {
    let text = include_str!("../config/kraft_like.toml").replacen("[remote]\n", MORE_LAYERS, 1);
    let config = parse("config/kraft_like.toml", &text);
    let mut bench = started(&config, scenario("contact_10s"), ());
    bench.run(200);
    IS_COUNTED.set(true);
    bench.run(10_000);
    IS_COUNTED.set(false);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0);
}

#[test]
fn node_behind_a_link_with_delay_never_allocates() {
    let config = config("config/kraft_like.toml");
    let simulated = Some(DelaySettings {
        delay: Duration::from_millis(2),
        jitter: Duration::from_millis(3),
        loss: 0.05,
        reorders: true,
        ..DelaySettings::default()
    });
    let link = RemoteLink { simulated, ..config.link };
    let config = config.with_link(link);
    let mut bench = started(&config, scenario("contact_10s"), ());
    bench.run(200);
    IS_COUNTED.set(true);
    bench.run(5_000);
    IS_COUNTED.set(false);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0);
}

#[test]
fn cycle_with_a_robot_in_another_process_never_allocates() {
    let folder = tempfile::tempdir().unwrap();
    let path = SockAddr::unix(folder.path().join("link.sock")).unwrap();
    let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    listener.bind(&path).unwrap();
    listener.listen(1).unwrap();
    let robot = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    robot.connect(&path).unwrap();
    robot.set_nonblocking(true).unwrap();
    let mut far = FarEnd::new(1, 2, Duration::from_millis(100));
    let config = config("config/kraft_like.toml");
    let settings = link::LinkSettings {
        arm: 1,
        session: 1,
        period: config.period,
        round_trip: Duration::from_millis(5),
        stated: StatedCapability::from_interaction(
            &config.remote.interaction,
            &config.remote.servo,
        ),
    };
    let (mut side, mut thread) = link(listener, &settings).unwrap();
    let x_b_m = Isometry3::identity();
    let sensed = RemoteSample { at: Instant::ZERO, f_s: Wrench::ZERO, x_b_m, gripper: None };
    let mut received = 0;
    for millis in 1..2_000 {
        let now = Instant::from_micros(1_000 * millis);
        thread.step(now);
        let mut message = [0; 512];
        while let Ok(length) = (&robot).read(&mut message) {
            far.on_message(now, &message[..length]);
        }
        far.motion(now);
        robot.send(&far.feedback(now, &messages::measured(&sensed))).unwrap();
        if millis == 10 {
            side.begin_epoch();
        }
        IS_COUNTED.set(millis > 10);
        received += u32::from(side.exchange(now, &Command::HOLD).is_some());
        side.error();
        IS_COUNTED.set(false);
    }
    assert!(received > 1_900, "{received}");
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0);
}

#[test]
fn slave_arm_in_contact_never_allocates() {
    let link = LinkSettings {
        is_prismatic: false,
        alpha: 0.5,
        a: 0.2,
        d: 0.1,
        theta: 0.0,
        mass: 2.0,
        centre_of_mass: Vector3::new(0.0, 0.02, 0.08),
        inertia: Matrix3::from_diagonal_element(0.01),
        rotor_inertia: 0.1,
    };
    let joint = JointSettings { link, start: 0.2, coulomb: 0.5, viscous: 0.2, max_torque: 100.0 };
    let settings = ManipulatorSettings {
        joints: vec![joint; 7],
        x_b_0: Isometry3::identity(),
        x_n_m: Isometry3::identity(),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        servo_time_constant: 0.02,
        sensor: WristSensorSettings { noise: [0.1; 6], ..WristSensorSettings::IDEAL },
        seed: 1,
    };
    let load = Load {
        mass: 1.0,
        centre_of_mass: Vector3::zeros(),
        inertia: Matrix3::from_diagonal_element(1e-3),
    };
    let tool = Tool { shape: Shape::Cube { half_edge: 0.02 }, x_m_s: Isometry3::identity(), load };
    let free = Manipulator::new(&settings, tool, Scene::default()).unwrap();
    let surface = Surface { stiffness: 1e4, damping: 100.0, damping_depth: 1e-3, friction: 0.3 };
    let wall = Wall {
        point: free.x_b_m().translation.vector,
        normal: Unit::new_normalize(Vector3::z()),
        surface,
    };
    let scene = Scene { wall: Some(wall), ..Scene::default() };
    let mut arm = Manipulator::new(&settings, tool, scene).unwrap();
    IS_COUNTED.set(true);
    for _ in 0..1_000 {
        arm.step(2e-3, &[0.01; 9]);
    }
    IS_COUNTED.set(false);
    assert!(arm.f_s_sensed().is_finite());
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0);
}
