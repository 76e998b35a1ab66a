//! Far side with the node's end of the contract: each reason to hold, epochs, sessions, and a process that was stopped.

use std::path::Path;

use super::*;
use contract::{Gripper, Motion, NodeEnd, Order, PayloadRemoval, Reject, Sample};

const ARM: u16 = 1;
const MS: Duration = Duration::from_millis(1);
const PUMA: &str = "config/robots/puma560.toml";

/// Returns the configuration kraft_like with a robot, and changes of its text.
fn config(changes: &[(&str, &str)]) -> Config {
    let mut text = include_str!("../../../../config/kraft_like.toml").to_owned();
    for (old, new) in changes {
        assert!(text.contains(old), "{old}");
        text = text.replacen(old, new, 1);
    }
    let config = Config::parse(Path::new("config/kraft_like.toml"), &text).unwrap();
    config.with_robot(RobotArm::load(Path::new(PUMA)).unwrap())
}

/// Does not yield to contact.
const STIFF: (&str, &str) = ("accommodation_m_per_ns = 0.01 ", "accommodation_m_per_ns = 0.0 ");

/// Both ends, and the number of the cycle.
struct Ends {
    node: NodeEnd,
    far: FarRobot,
    cycle: u32,
    /// Command to the gripper.
    gripper: Option<Gripper>,
}

impl Ends {
    fn new(config: &Config, limits: RobotLimits) -> Self {
        let far = FarRobot::new(config, limits, ARM, 22, 1).unwrap();
        Self { node: NodeEnd::new(ARM, 11), far, cycle: 0, gripper: None }
    }

    /// Returns both ends, the node armed once.
    fn armed(config: &Config, limits: RobotLimits) -> Self {
        let mut ends = Self::new(config, limits);
        ends.run(Motion::Hold, 5);
        ends.node.begin_epoch();
        ends
    }

    fn usual() -> Self {
        Self::armed(&config(&[]), RobotLimits::default())
    }

    fn now(&self) -> Instant {
        Instant::ZERO + MS * self.cycle
    }

    fn command(&mut self, motion: Motion) -> [u8; contract::Command::LENGTH] {
        let now = self.now();
        self.node.command(now, &Order { motion, is_engaged: true, gripper: self.gripper })
    }

    /// Exchanges once, with what `supply` makes of the measurements.
    fn exchange(
        &mut self,
        motion: Motion,
        supply: impl FnOnce(Measurement) -> Measurement,
    ) -> Option<Sample> {
        self.cycle += 1;
        let (now, command) = (self.now(), self.command(motion));
        self.far.on_message(now, &command);
        let Outgoing { feedback, capability } = self.far.step_with(now, supply);
        if let Some(capability) = capability {
            self.node.on_message(now, &capability);
        }
        self.node.on_message(now, &feedback)
    }

    /// Exchanges `cycles` times; returns the last feedback.
    fn run(&mut self, motion: Motion, cycles: u32) -> Option<Feedback> {
        let samples = (0..cycles).map(|_| self.exchange(motion, |it| it));
        samples.last().flatten().map(|sample| sample.feedback)
    }

    /// Performs cycles of the robot alone.
    fn step_alone(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle += 1;
            let now = self.now();
            self.far.step(now);
        }
    }

    /// Distance along the approach, in m, that the robot moves in `cycles`.
    fn moved(&mut self, motion: Motion, cycles: u32) -> f64 {
        let before = *self.far.site().pose();
        self.run(motion, cycles);
        (before.inverse() * self.far.site().pose()).translation.vector.norm()
    }

    fn force(&self) -> f64 {
        self.far.site().arm().f_m_contact().force.norm()
    }
}

/// Rate along the approach of the tool, in m/s: into the wall.
const fn ahead(speed: f64) -> Motion {
    Motion::Rate([0.0, 0.0, speed, 0.0, 0.0, 0.0])
}

#[test]
fn robot_follows_only_after_an_arming() {
    let mut ends = Ends::new(&config(&[]), RobotLimits::default());
    assert!(ends.moved(ahead(0.05), 200) < 1e-6);
    assert_eq!(ends.far.reason(), Reason::NotArmed);
    ends.node.begin_epoch();
    let moved = ends.moved(ahead(0.05), 200);
    assert!((0.008..0.01).contains(&moved), "{moved} m");
    assert_eq!((ends.far.reason(), ends.far.leader()), (Reason::None, (11, 1)));
}

#[test]
fn robot_follows_poses() {
    let mut ends = Ends::usual();
    let goal = ends.far.site().pose() * nalgebra::Isometry3::translation(0.01, 0.0, -0.02);
    let pose = messages::order(&units::spatial::Motion::Pose(goal).into()).motion;
    ends.run(pose, 2_000);
    let off = (goal.inverse() * ends.far.site().pose()).translation.vector.norm();
    assert!(off < 1e-4, "{off} m");
}

#[test]
fn robot_grips_with_the_commanded_force_and_keeps_it_on_a_hold() {
    let gripper = "[remote.gripper]\nstroke_m = 0.08\nmax_speed_m_per_s = 0.2\nobject_m = 0.03\n\
        stiffness_n_per_m = 5000.0\n\n[safety]";
    let config = config(&[("[safety]", gripper)]);
    let mut ends = Ends::new(&config, RobotLimits::default());
    assert!(ends.far.figures().has_gripper && !Ends::usual().far.figures().has_gripper);
    ends.gripper = Some(Gripper { position: 0.0, force: 12.0 });
    let unarmed = ends.run(Motion::Hold, 500).unwrap().measured.gripper.unwrap();
    assert!((unarmed.position - 0.08).abs() < 1e-9, "not armed: {unarmed:?}");
    ends.node.begin_epoch();
    let gripped = ends.run(Motion::Hold, 500).unwrap().measured.gripper.unwrap();
    assert!((gripped.force - 12.0).abs() < 1e-6, "{gripped:?}");
    ends.far.end();
    ends.gripper = Some(Gripper { position: 0.08, force: 12.0 });
    let held = ends.run(Motion::Hold, 500).unwrap();
    assert_eq!((held.reason, held.measured.gripper), (Reason::Ending, Some(gripped)));
}

#[test]
fn feedback_has_pose_and_wrench_of_the_contact() {
    let mut ends = Ends::usual();
    let free = ends.run(ahead(0.05), 100).unwrap().measured;
    let position = free.pose.unwrap().position;
    let real: [f64; 3] = ends.far.site().pose().translation.vector.into();
    assert!(position.iter().zip(real).all(|(a, b)| (a - b).abs() < 1e-3), "{position:?} {real:?}");
    let pressed = ends.run(ahead(0.05), 4_000).unwrap().measured.wrench.unwrap();
    let force = ends.force();
    assert!(force > 3.0 && (pressed[2] + force).abs() < 0.2, "{pressed:?} {force}");
}

#[test]
fn hazard_34_silence_holds_until_a_new_epoch() {
    let mut ends = Ends::usual();
    ends.run(ahead(0.05), 200);
    // The newest command echoes the feedback of the cycle before.
    ends.step_alone(99);
    assert_eq!(ends.far.reason(), Reason::None);
    ends.step_alone(1);
    assert_eq!(ends.far.reason(), Reason::Silence);
    ends.step_alone(400);
    assert!(ends.moved(ahead(0.05), 300) < 1e-5);
    assert_eq!(ends.far.reason(), Reason::Silence);
    ends.node.begin_epoch();
    assert!(ends.moved(ahead(0.05), 100) > 3e-3);
}

/// Returns the distance, in m, that the robot moves at `speed` after the newest command of a node that is killed.
fn moved_after_a_kill(hold_after: Duration, speed: f64) -> f64 {
    let limits = RobotLimits { hold_after, ..RobotLimits::default() };
    let mut ends = Ends::armed(&config(&[]), limits);
    ends.run(ahead(speed), 300);
    let before = *ends.far.site().pose();
    ends.step_alone(3_000);
    assert_eq!(ends.far.reason(), Reason::Silence);
    let x_m_m = before.inverse() * ends.far.site().pose();
    x_m_m.translation.vector.norm()
}

#[test]
#[expect(clippy::print_stdout, reason = "docs/robots.md has the figures")]
fn hazard_34_robot_of_a_killed_node_stops_in_its_hold_after() {
    // Away from the wall, up to the maximum speed of the file.
    for speed in [-0.063, -0.25, -0.5] {
        let [usual, longer] = [MS * 100, MS * 300].map(|age| moved_after_a_kill(age, speed));
        println!("{speed} m/s: {:.1} mm at 100 ms, {:.1} mm at 300 ms", usual * 1e3, longer * 1e3);
        // The servo's lag of 10 ms is in the speed before, and in the stop.
        let way = |age: f64| speed.abs() * age;
        assert!(usual > way(0.09) && usual < way(0.115), "{speed} m/s: {usual} m");
        assert!(longer > way(0.28) && longer < way(0.315), "{speed} m/s: {longer} m");
    }
}

/// Returns the measurements with wrong values.
type Corruption = fn(Measurement) -> Measurement;

fn with_force(mut measurement: Measurement, force: f64) -> Measurement {
    measurement.reading.force.y = force;
    measurement
}

fn with_moment(mut measurement: Measurement, moment: f64) -> Measurement {
    measurement.reading.moment.x = moment;
    measurement
}

/// Wrong values of sensor and joints, each with its reason to hold.
const CORRUPTIONS: [(Corruption, Reason); 8] = [
    (|it| with_force(it, 200.0), Reason::SensorSaturated),
    (|it| with_force(it, -200.1), Reason::SensorSaturated),
    (|it| with_moment(it, 20.0), Reason::SensorSaturated),
    (|it| with_moment(it, -20.0), Reason::SensorSaturated),
    (|it| with_force(it, f64::NAN), Reason::SensorInvalid),
    (|it| with_moment(it, f64::INFINITY), Reason::SensorInvalid),
    (|it| Measurement { reading_number: 7, ..it }, Reason::SensorSilent),
    (|it| Measurement { q: it.q * f64::NAN, ..it }, Reason::Robot),
];

#[test]
fn faults_of_sensor_and_joints_hold_until_a_new_epoch() {
    for (place, (corruption, reason)) in CORRUPTIONS.into_iter().enumerate() {
        let mut ends = Ends::usual();
        ends.run(ahead(0.05), 200);
        let faulty = (0..200).map(|_| ends.exchange(ahead(0.05), corruption));
        let feedback = faulty.last().flatten().unwrap().feedback;
        assert_eq!(feedback.reason, reason, "{place}");
        assert_eq!(feedback.measured.wrench, None, "{place}");
        assert_eq!(feedback.measured.pose.is_none(), reason == Reason::Robot, "{place}");
        assert!(ends.moved(ahead(0.05), 300) < 2e-5, "{place}");
        assert_eq!(ends.far.reason(), reason, "{place}: the sensor is well again");
        ends.node.begin_epoch();
        assert!(ends.moved(ahead(0.05), 100) > 3e-3, "{place}");
    }
}

#[test]
fn fault_that_lasts_holds_in_a_new_epoch_as_well() {
    for (corruption, reason) in CORRUPTIONS {
        let mut ends = Ends::usual();
        (0..10).for_each(|_| _ = ends.exchange(ahead(0.05), corruption));
        let before = *ends.far.site().pose();
        ends.node.begin_epoch();
        for _ in 0..300 {
            ends.exchange(ahead(0.05), corruption);
            assert_eq!(ends.far.reason(), reason);
        }
        let moved = (before.inverse() * ends.far.site().pose()).translation.vector.norm();
        assert!(moved < 1e-3, "{reason}: {moved} m");
    }
}

#[test]
fn wrench_is_sent_with_new_readings_only() {
    let mut ends = Ends::usual();
    ends.run(ahead(0.05), 10);
    let number = ends.far.site().measurement().reading_number;
    for missed in 1..=5 {
        let repeated = |it| Measurement { reading_number: number, ..it };
        let feedback = ends.exchange(ahead(0.05), repeated).unwrap().feedback;
        assert_eq!(feedback.measured.wrench, None);
        let reason = if missed < 3 { Reason::None } else { Reason::SensorSilent };
        assert_eq!(feedback.reason, reason, "{missed} missed");
    }
}

#[test]
fn sensor_of_the_simulation_saturates_at_its_range() {
    let sensor_range = SensorRange { force: 15.0, moment: 20.0 };
    let limits = RobotLimits { sensor_range, ..RobotLimits::default() };
    let mut ends = Ends::armed(&config(&[STIFF]), limits);
    ends.run(ahead(0.05), 3_000);
    assert_eq!(ends.far.reason(), Reason::SensorSaturated);
    let force = ends.force();
    assert!((5.0..40.0).contains(&force), "{force} N");
}

/// Returns a robot that was stopped by its wrench limit of 30 N while fast, and is armed again while still above it.
fn stopped_above_its_limit() -> Ends {
    let wrench = WrenchLimit { force: 30.0, moment: 10.0 };
    let limits = RobotLimits { wrench, ..RobotLimits::default() };
    let mut ends = Ends::armed(&config(&[STIFF]), limits);
    ends.run(ahead(0.2), 1);
    while ends.far.reason() == Reason::None {
        ends.run(ahead(0.2), 1);
    }
    ends.run(ahead(0.2), 48);
    assert_eq!(ends.far.reason(), Reason::WrenchLimit);
    let force = ends.far.site().control().contact().force.norm();
    assert!((33.0..40.0).contains(&force), "{force} N");
    ends.node.begin_epoch();
    ends
}

#[test]
fn robot_stopped_above_its_limit_leaves_the_contact() {
    let mut ends = stopped_above_its_limit();
    for _ in 0..2_000 {
        ends.run(ahead(-0.05), 1);
        assert_eq!(ends.far.reason(), Reason::None);
    }
    assert!(ends.force() < 0.1, "{} N", ends.force());
    ends.run(ahead(0.05), 4_000);
    assert_eq!(ends.far.reason(), Reason::WrenchLimit);
    assert!(ends.force() < 31.0, "the limit is full again: {} N", ends.force());
}

#[test]
fn repeated_resets_push_no_robot_further_in() {
    // Straight, and with turns of the cube at its front, whose corners are beside {MRF}.
    for command in [ahead(0.05), Motion::Rate([0.02, 0.0, 0.1, 0.3, -0.5, 0.2])] {
        let mut ends = stopped_above_its_limit();
        let before = ends.force();
        let mut most = before;
        for cycle in 0..5_000 {
            if cycle % 200 == 0 {
                ends.node.begin_epoch();
            }
            ends.run(command, 1);
            most = most.max(ends.force());
        }
        assert!(most < 1.03 * before, "{command:?}: {before} N, then {most} N");
    }
}

#[test]
fn hold_in_contact_stays_where_the_robot_is() {
    let mut ends = Ends::usual();
    let mut depth = 0.0;
    let start = *ends.far.site().pose();
    while ends.force() < 3.0 {
        depth += 3e-4;
        let goal = start * nalgebra::Isometry3::translation(0.0, 0.0, depth);
        ends.run(messages::order(&units::spatial::Motion::Pose(goal).into()).motion, 1);
    }
    ends.exchange(Motion::Hold, |it| with_force(it, f64::NAN));
    let at_hold = *ends.far.site().pose();
    ends.step_alone(3_000);
    assert_eq!(ends.far.reason(), Reason::SensorInvalid);
    let off = (at_hold.inverse() * ends.far.site().pose()).translation.vector.norm();
    assert!(off < 2e-3 && (1.0..5.0).contains(&ends.force()), "{off} m, {} N", ends.force());
}

#[test]
fn ending_robot_holds_in_every_epoch() {
    let mut ends = Ends::usual();
    ends.run(ahead(0.05), 200);
    ends.far.end();
    let feedback = ends.run(ahead(0.05), 200).unwrap();
    assert_eq!(feedback.reason, Reason::Ending);
    ends.node.begin_epoch();
    assert!(ends.moved(ahead(0.05), 200) < 2e-5);
    assert_eq!(ends.far.reason(), Reason::Ending);
}

#[test]
fn command_of_an_older_epoch_has_no_effect() {
    let mut ends = Ends::usual();
    ends.run(ahead(0.05), 50);
    let old = ends.command(ahead(-0.5));
    ends.node.begin_epoch();
    ends.run(Motion::Hold, 200);
    let before = *ends.far.site().pose();
    let now = ends.now();
    ends.far.on_message(now, &old);
    ends.step_alone(20);
    let moved = (before.inverse() * ends.far.site().pose()).translation.vector.norm();
    assert!(moved < 1e-5, "{moved} m");
    assert_eq!(ends.far.leader(), (11, 2));
}

#[test]
fn node_started_again_leads_after_an_arming() {
    let mut ends = Ends::usual();
    ends.run(ahead(0.05), 200);
    ends.step_alone(300);
    ends.node = NodeEnd::new(ARM, 44);
    assert!(ends.moved(ahead(0.05), 300) < 1e-5);
    assert_eq!((ends.far.leader(), ends.far.reason()), ((44, 0), Reason::NotArmed));
    ends.node.begin_epoch();
    assert!(ends.moved(ahead(0.05), 100) > 3e-3);
}

#[test]
fn hazard_35_stopped_process_acts_on_none_of_3000_commands() {
    let mut ends = Ends::usual();
    ends.run(ahead(0.05), 200);
    let backlog: Vec<_> = (0..3_000)
        .map(|_| {
            ends.cycle += 1;
            ends.command(ahead(0.3))
        })
        .collect();
    let before = *ends.far.site().pose();
    for sixteen in backlog.chunks(16) {
        ends.cycle += 1;
        let now = ends.now();
        sixteen.iter().for_each(|command| ends.far.on_message(now, command));
        ends.far.step(now);
        assert_eq!(ends.far.reason(), Reason::Silence);
    }
    assert_eq!(ends.far.status().rejects.get(Reject::Old), 3_000);
    // The simulation moves for ten periods at most with the rates from before the stop.
    let moved = (before.inverse() * ends.far.site().pose()).translation.vector.norm();
    assert!(moved < 0.05 * 0.012, "{moved} m");
    assert!(ends.moved(ahead(0.3), 100) < 1e-4, "fresh commands of the same epoch");
}

#[test]
fn capability_has_the_figures_of_the_configuration() {
    let changes = [
        ("mass_kg = 0.8", "remove_inertia = true\naccommodation_deadband_n = 1.5\nmass_kg = 0.8"),
        ("max_turn_rad_per_s = 2.0", "max_turn_rad_per_s = 1.5"),
    ];
    let config = config(&changes);
    let limits = RobotLimits { hold_after: MS * 80, ..RobotLimits::default() };
    let mut ends = Ends::new(&config, limits);
    ends.run(Motion::Hold, 5);
    let figures = *ends.node.capability().unwrap();
    assert_eq!(figures, *ends.far.figures());
    let expected = Capability {
        senses_wrench: true,
        senses_pose: true,
        has_gripper: false,
        follows_rates: true,
        follows_poses: true,
        payload_removal: PayloadRemoval::Inertia,
        accommodation: [0.01, 0.01, 0.01, 0.5, 0.5, 0.5],
        deadband: [1.5, 1.5, 1.5, 0.0, 0.0, 0.0],
        servo_lag: 0.01,
        sample_period: 0.001,
        hold_after: 0.08,
        sensor_range: [200.0, 20.0],
        stiffest_contact: 2_000.0,
        max_speed: [0.5, 1.5],
        workspace: figures.workspace,
    };
    assert_eq!(figures, expected);
}

#[test]
fn payload_removal_is_that_of_what_the_operator_feels() {
    let mass = "mass_kg = 0.8";
    for (key, removal) in [
        ("feel_payload = true", PayloadRemoval::None),
        ("feel_payload = false", PayloadRemoval::Weight),
    ] {
        let config = config(&[(mass, &format!("{key}\n{mass}"))]);
        let far = FarRobot::new(&config, RobotLimits::default(), ARM, 22, 1).unwrap();
        assert_eq!(far.figures().payload_removal, removal, "{key}");
    }
}

#[test]
fn workspace_contains_every_posture() {
    let config = config(&[]);
    let robot = config.robot.as_ref().unwrap();
    let [low, high] = workspace(robot);
    let mut q = robot.start();
    for posture in 0..2_000_u32 {
        for (joint, (q, limit)) in (1..).zip(q.iter_mut().zip(robot.law().limits().joints())) {
            let [low, high] = limit.range;
            let share = (f64::from(posture) * f64::from(joint) * 0.618).fract();
            *q = if low.is_finite() { low + share * (high - low) } else { 0.0 };
        }
        let x_b_m = robot.law().chain().forward(&q);
        let position: [f64; 3] = x_b_m.translation.vector.into();
        let bounds = low.iter().zip(&high).zip(position);
        assert!(bounds.into_iter().all(|((low, high), at)| *low <= at && at <= *high));
    }
}

#[test]
fn robot_in_contact_at_its_start_is_refused() {
    let inside = config(&[("point_m = [0.47, 0.0, 0.0]", "point_m = [0.41, 0.0, 0.0]")]);
    let refused = FarRobot::new(&inside, RobotLimits::default(), ARM, 22, 1).unwrap_err();
    assert!(matches!(refused, NoRobot::StartsInContact { .. }), "{refused}");
    let free = Config::load(Path::new("config/kraft_like.toml")).unwrap();
    let refused = FarRobot::new(&free, RobotLimits::default(), ARM, 22, 1).unwrap_err();
    assert!(matches!(refused, NoRobot::NoArm), "{refused}");
}
