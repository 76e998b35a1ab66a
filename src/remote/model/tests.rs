use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::Remote;
use crate::site::VirtualSite;
use robot::accommodation::Accommodation;
use robot::chain::{Chain, Joints, Link};
use robot::damped_inverse::DampedInverse;
use robot::following_arm::FollowingArm;
use robot::joint_limits::{JointLimit, JointLimits};
use robot::object::Servo;
use robot::resolved_rate::ResolvedRate;
use units::math;
use units::spatial::Twist;

const MS: Duration = Duration::from_millis(1);

/// Limit of these tests: travel in 40 ms at 0.5 m/s and 2 rad/s.
const LIMIT: Difference = Difference { distance: 0.02, angle: 0.08 };

/// Network between node and robot.
#[derive(Clone, Copy, Debug)]
struct Network {
    delay_ms: u64,
    jitter_ms: u64,
    loss_percent: u32,
}

fn network() -> impl Strategy<Value = Network> {
    (0..15_u64, 0..5_u64, 0..20_u32).prop_map(|(delay_ms, jitter_ms, loss_percent)| Network {
        delay_ms,
        jitter_ms,
        loss_percent,
    })
}

/// Random generator of a network; the first number of each pair decides on loss.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % sides
    }

    /// Returns the delay of a message in ms; `None` if it is lost.
    fn delay(&mut self, network: Network) -> Option<u64> {
        let is_lost = self.roll(100) < network.loss_percent.into();
        (!is_lost).then(|| network.delay_ms + self.roll(network.jitter_ms + 1))
    }
}

/// Returns the law of an arm with six joints.
fn law() -> ResolvedRate {
    let link = |alpha: f64, a: f64, d: f64| Link { alpha, a, d, theta: 0.0 };
    let links = [
        link(0.0, 0.0, 0.67183),
        link(FRAC_PI_2, 0.0, 0.0),
        link(0.0, 0.4318, 0.15005),
        link(-FRAC_PI_2, 0.0203, 0.4318),
        link(FRAC_PI_2, 0.0, 0.0),
        link(-FRAC_PI_2, 0.0, 0.0),
    ];
    let tool = Isometry3::translation(0.0, 0.0, 0.12);
    let chain = Chain::new(Isometry3::identity(), &links, tool).unwrap();
    let limit = JointLimit { range: [-2.8, 2.8], max_rate: 3.0, max_acceleration: 100.0 };
    let limits = JointLimits::new((0..6).map(|_| limit));
    ResolvedRate::new(chain, DampedInverse::default(), limits, 0.5).unwrap()
}

/// Returns the arm at a posture far from singularities.
fn arm() -> FollowingArm {
    FollowingArm::new(law(), Joints::from([0.1, 0.6, -1.9, 0.2, 0.9, 0.1, 0.0, 0.0, 0.0]))
}

/// Returns an object without a scene, free unless `arm` holds it.
fn remote(arm: Option<FollowingArm>, yields: f64) -> Virtual {
    let accommodation = Accommodation::new([yields; 6], [0.0; 6]).unwrap();
    Virtual {
        x_b_m: arm.map_or_else(|| Isometry3::translation(0.4, 0.0, 0.3), |arm| arm.pose()),
        arm,
        interaction: Interaction { accommodation, ..Interaction::default() },
        servo: Servo::new(0.034, 0.5, 2.0).unwrap(),
        coupling: None,
        wall: None,
        block: None,
        sphere: None,
        gripper: None,
    }
}

/// Robot behind a network, and its model in the node.
struct Session {
    network: Network,
    dice: Dice,
    there: Vec<(u64, u64, Motion)>,
    back: Vec<(u64, RemoteSample)>,
    /// Number and motion of the newest command that the robot has received.
    led: (u64, Motion),
    model: Model,
    newest: Option<RemoteSample>,
    at_ms: u64,
}

impl Session {
    fn new(remote: &Virtual, network: Network, seed: u64) -> Self {
        Self {
            network,
            dice: Dice(seed),
            there: Vec::new(),
            back: Vec::new(),
            led: (0, Motion::Hold),
            model: Model::new(remote, LIMIT, MS),
            newest: None,
            at_ms: 0,
        }
    }

    fn at(ms: u64) -> Instant {
        Instant::ZERO + MS * u32::try_from(ms).unwrap()
    }

    /// Runs a cycle of the node and one of the robot, which moves by `follow`; returns the difference.
    fn cycle(
        &mut self,
        command: Motion,
        follow: impl FnOnce(Instant, &Motion) -> RemoteSample,
    ) -> Option<Difference> {
        self.at_ms += 1;
        let (ms, network) = (self.at_ms, self.network);
        if let Some(delay) = self.dice.delay(network) {
            self.there.push((ms + delay, ms, command));
        }
        let newest =
            self.there.iter().filter(|(due, ..)| *due <= ms).max_by_key(|(_, sent, _)| *sent);
        if let Some((_, sent, motion)) = newest
            && *sent > self.led.0
        {
            self.led = (*sent, *motion);
        }
        self.there.retain(|(due, ..)| *due > ms);
        let sensed = RemoteSample { at: Self::at(self.led.0), ..follow(Self::at(ms), &self.led.1) };
        if let Some(delay) = self.dice.delay(network) {
            self.back.push((ms + delay, sensed));
        }
        for (_, sensed) in self.back.iter().filter(|(due, _)| *due <= ms) {
            if self.newest.is_none_or(|newest| newest.at <= sensed.at) {
                self.newest = Some(*sensed);
            }
        }
        self.back.retain(|(due, _)| *due > ms);
        self.model.exchange(Self::at(ms), &command, self.newest.as_ref());
        self.model.difference()
    }
}

/// Returns the command of a hand: a hold, then an oscillation along an axis, by rate or pose.
fn hand(ms: u32, start: &Isometry3<f64>, hz: f64, is_rate: bool) -> Motion {
    let t = f64::from(ms) * 1e-3 - 0.2;
    let phase = std::f64::consts::TAU * hz * t;
    match (t > 0.0, is_rate) {
        (false, _) => Motion::Hold,
        (true, true) => {
            let (v, w) = (0.2 * math::sin(phase), 0.6 * math::sin(phase));
            Motion::Rate(Twist::from_components([v, 0.0, -v, 0.0, w, 0.0]))
        }
        (true, false) => {
            let (x, turn) = (0.05 * math::sin(phase), 0.1 * math::sin(phase));
            Motion::Pose(start * Isometry3::new([x, 0.0, 0.0].into(), [0.0, 0.0, turn].into()))
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn hazard_49_delay_jitter_and_loss_are_no_difference(
        network in network(), seed: u64, hz in 0.1..1.5_f64, is_rate: bool
    ) {
        let remote = remote(None, 0.0);
        let mut robot = VirtualSite::new(&remote, MS);
        let mut session = Session::new(&remote, network, seed);
        for ms in 0..10_000 {
            let command = hand(ms, &remote.x_b_m, hz, is_rate);
            let follow = |now, motion: &Motion| robot.exchange(now, &(*motion).into()).unwrap();
            let difference = session.cycle(command, follow);
            prop_assert!(session.model.excess().is_none(), "{ms} ms: {difference:?}");
        }
    }

    #[test]
    fn hazard_49_blocked_joint_is_found(joint in 0..6_usize, is_rate: bool, seed: u64) {
        let held = arm();
        let remote = remote(Some(held), 0.0);
        let network = Network { delay_ms: 5, jitter_ms: 2, loss_percent: 1 };
        let mut session = Session::new(&remote, network, seed);
        let mut robot = Object::new(remote.servo, remote.x_b_m).held_by(held);
        let found = (0..4_000).find(|ms| {
            let command = hand(*ms, &remote.x_b_m, 0.25, is_rate);
            // The motor of one joint is decoupled.
            let step = |_, motion: &Motion| {
                robot.step(1e-3, motion, &Wrench::ZERO);
                let mut q = *robot.arm().unwrap().q();
                q[joint] = held.q()[joint];
                robot = robot.held_by(FollowingArm::new(law(), q));
                let x_b_m = *robot.pose();
                RemoteSample { at: Instant::ZERO, f_s: Wrench::ZERO, x_b_m, gripper: None }
            };
            session.cycle(command, step);
            session.model.excess().is_some()
        });
        prop_assert!(found.is_some(), "{:?}", session.model.difference());
    }
}

#[test]
fn contact_that_the_robot_yields_to_is_no_difference() {
    let remote = Virtual {
        wall: Some((
            Vector3::new(0.45, 0.0, 0.0),
            -Vector3::x_axis(),
            crate::site::Contact { stiffness: 2_000.0, damping: 20.0, friction: 0.0 },
        )),
        ..remote(None, 0.01)
    };
    let network = Network { delay_ms: 5, jitter_ms: 2, loss_percent: 1 };
    let mut session = Session::new(&remote, network, 1);
    let mut robot = VirtualSite::new(&remote, MS);
    let mut most: f64 = 0.0;
    let mut pressed: f64 = 0.0;
    for ms in 0..60_000 {
        let command = if ms < 200 {
            Motion::Hold
        } else {
            Motion::Rate(Twist::from_components([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]))
        };
        let follow = |now, motion: &Motion| robot.exchange(now, &(*motion).into()).unwrap();
        let found = session.cycle(command, follow);
        most = most.max(found.unwrap_or_default().distance);
        pressed = pressed.max(session.newest.map_or(0.0, |sensed| -sensed.f_s.force.x));
    }
    assert!(pressed > 4.0, "{pressed} N");
    assert!(most < 0.5 * LIMIT.distance, "{most} m");
}

#[test]
fn robot_is_where_it_is_while_nothing_is_commanded() {
    let remote = remote(None, 0.0);
    let network = Network { delay_ms: 0, jitter_ms: 0, loss_percent: 0 };
    let mut session = Session::new(&remote, network, 1);
    for ms in 0..50 {
        let x_b_m = Isometry3::translation(f64::from(ms), 0.0, 0.0);
        let sensed = RemoteSample { at: Instant::ZERO, f_s: Wrench::ZERO, x_b_m, gripper: None };
        let difference = session.cycle(Motion::Hold, |_, _| sensed);
        assert_eq!(difference, Some(Difference::default()), "moved by hand");
    }
}

#[test]
fn shown_arm_follows_the_sensed_pose() {
    let held = arm();
    let mut model = Model::new(&remote(Some(held), 0.0), LIMIT, MS);
    let reached = Joints::from([0.2, 0.5, -2.0, 0.1, 1.0, 0.3, 0.0, 0.0, 0.0]);
    let x_b_m = FollowingArm::new(law(), reached).pose();
    let sensed = RemoteSample { at: Instant::ZERO, f_s: Wrench::ZERO, x_b_m, gripper: None };
    assert_eq!(model.joints(), Some(RobotJoints((*held.q()).into())));
    for ms in 1..2_000 {
        model.exchange(Session::at(ms), &Motion::Hold, Some(&sensed));
    }
    let off = Difference::between(model.shown.unwrap().pose(), &x_b_m);
    assert!(off.distance < 1e-5 && off.angle < 1e-5, "{off:?}");
}

#[test]
fn difference_that_is_no_number_exceeds_every_limit() {
    for nan in [
        Difference { distance: f64::NAN, angle: 0.0 },
        Difference { distance: 0.0, angle: f64::NAN },
    ] {
        assert!(nan.exceeds(&LIMIT), "{nan:?}");
    }
    assert!(!LIMIT.exceeds(&LIMIT));
}
