//! Environment of the node: six drives and a switch box on their buses, the arm they move, and the operator's hand.
//!
//! At every SYNC the arm first advances to that time with the torques that acted until then. Then the drives sample it
//! and receive the SYNC. Without SYNCs the arm advances every millisecond, and at each change of a demand. So a demand
//! acts exactly from and to the times of the drive, with the lag of its current loop.

use std::time::Duration;

use nalgebra::{Isometry3, Translation3};

use crate::arm::Joints;
use crate::cradle::Cradle;
use crate::drive::Drive;
use crate::drivetrain::{Drivetrain, MotorReading};
use crate::extremes::Extremes;
use crate::fault::devices::{Devices, present};
use crate::fault::{Breakable, Faults, Notice};
use crate::guide::Guide;
use crate::motors::Motors;
use crate::operator_model::OperatorModel;
use crate::plant::{self, Plant};
use crate::scenario::Scenario;
use crate::scenario_start::ScenarioStart;
use crate::switches::SwitchBox;
use crate::transmission::Transmission;
use canopen::drive::State;
use canopen::frame::{Channel, Frame, Telegram};
use canopen::sync;
use canopen_device::station::Station;
use faults::LinkFault;
use units::numbering::Joint;
use units::time::Instant;

/// Maximum time between two steps of the arm.
const TICK: Duration = Duration::from_millis(1);

/// As [`TICK`], where the world advances [ahead of SYNC](World::ahead_of_sync): one step of the arm is left for it at 1 kHz.
const AHEAD: Duration = Duration::from_micros(600);

/// Time in which an operator sees that the drives are off: what a stop does to the hand is over.
const LAYS_DOWN_AFTER: Duration = Duration::from_millis(200);

/// Maximum time that the arm advances in one call.
const MAX_ADVANCE: Duration = Duration::from_millis(100);

/// Torque demand that counts as zero, in ‰ of rated torque: half the resolution of a target.
const RESOLUTION: f64 = 0.5;

/// Bus whose SYNC the arm and the scenario follow; the other buses follow within microseconds.
const LEADING: Channel = Channel(0);

/// Interface of a drive to the plant.
pub trait Motor: Breakable {
    /// Updates the motor and encoder values at `now`.
    fn sense(&mut self, now: Instant, sensed: &MotorReading);

    /// Returns the torque demand, in ‰ of rated torque.
    fn demand(&self) -> f64;

    /// Returns whether it is in operation enabled.
    fn is_enabled(&self) -> bool {
        true
    }
}

/// Interface of an input module to the operator.
pub trait Inputs: Breakable {
    /// Sets the eight digital inputs.
    fn set(&mut self, inputs: u8);

    /// Sets the lever of a gripper, in counts.
    fn set_lever(&mut self, _counts: i16) {}
}

/// Devices on the buses, with the arm and its operator.
#[derive(Clone, Debug)]
pub struct World<M = Drive, I = SwitchBox> {
    drives: [M; 6],
    motors: Motors,
    /// Switch box of the operator, if configured.
    switches: Option<I>,
    plant: Plant,
    operator: OperatorModel,
    faults: Faults,
    scenario: Scenario,
    /// Pose of the grip at the start, to which the movements of the scenario are relative.
    x_0_start: Isometry3<f64>,
    /// Desired pose of the grip instead of that of the scenario.
    aim: Option<Isometry3<f64>>,
    /// Time zero of the scenario.
    start: ScenarioStart,
    /// Time of the arm.
    now: Instant,
    /// Time since which no drive demands torque.
    zero_torque_since: Option<Instant>,
    /// Joint torques of an external push, in N·m (N).
    tau_push: Joints,
    cradle: Cradle,
    /// Hands on the links of an arm without torque.
    guide: Option<Guide>,
    /// Set if the operator lays the arm down after all drives are off.
    lays_down: bool,
    /// Time since which all drives are off.
    off_since: Option<Instant>,
    extremes: Option<Extremes>,
    /// Time after which the arm advances without a SYNC.
    tick: Duration,
}

impl<M: Motor, I: Inputs> World<M, I> {
    /// Creates the world with the arm at rest as in `plant`, held by the hand.
    pub fn new(
        drives: [M; 6],
        drivetrains: [Drivetrain; 6],
        switches: Option<I>,
        plant: Plant,
        scenario: Scenario,
        seed: u64,
    ) -> Self {
        let mut world = Self {
            drives,
            motors: Motors::new(drivetrains),
            switches,
            x_0_start: *plant.x_0_g(),
            aim: None,
            plant,
            operator: OperatorModel::new(scenario.operator_settings(), seed),
            faults: Faults::new(scenario.faults(), seed),
            scenario,
            start: ScenarioStart::default(),
            now: Instant::ZERO,
            zero_torque_since: Some(Instant::ZERO),
            tau_push: Joints::zeros(),
            cradle: Cradle::none(),
            guide: None,
            lays_down: true,
            off_since: None,
            extremes: None,
            tick: TICK,
        };
        world.show();
        world
    }

    /// Sets the transmission between drives and joints.
    #[must_use]
    pub fn coupled(self, transmission: Transmission) -> Self {
        let mut world = Self { motors: self.motors.coupled(transmission), ..self };
        world.show();
        world
    }

    /// Advances the arm ahead of each SYNC, whose answer then takes as long in contact as without: on a real bus, where
    /// computing takes time.
    #[must_use]
    pub fn ahead_of_sync(self) -> Self {
        Self { tick: AHEAD, ..self }
    }

    /// Puts the cradle to other rest positions, in rad (m), where it stays when the arm leaves it.
    pub fn fix_cradle(&mut self, rest: Joints) {
        self.cradle = self.cradle.fixed(rest);
    }

    /// Rests the arm in a cradle until the drives carry it.
    #[must_use]
    pub fn resting(self, cradle: Cradle) -> Self {
        Self { cradle, ..self }
    }

    /// Replaces the scenario and keeps its time; faults of the past occur at once. `seed` is that of random faults.
    pub fn set_scenario(&mut self, scenario: Scenario, seed: u64) {
        self.faults = Faults::new(scenario.faults(), seed);
        self.scenario_start().into_iter().for_each(|begun| self.faults.begin(begun));
        self.scenario = scenario;
    }

    /// Returns the time of the arm.
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Returns the drives, base first.
    pub const fn drives(&self) -> &[M; 6] {
        &self.drives
    }

    /// Returns the drive of a joint, to inject faults.
    pub fn drive_mut(&mut self, joint: Joint) -> Option<&mut M> {
        self.drives.get_mut(joint.index())
    }

    /// Returns the switch box, to inject faults.
    pub const fn switches_mut(&mut self) -> Option<&mut I> {
        self.switches.as_mut()
    }

    /// Returns the actuator torques, base first, in N·m (N).
    pub fn torques(&self) -> Joints {
        self.motors.torques()
    }

    /// Returns the arm.
    pub const fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Sets joint torques of an external push, in N·m (N), in addition to motors and hand.
    pub fn set_push(&mut self, tau: &Joints) {
        self.tau_push = *tau;
    }

    /// Guides the joints of an arm without torque to a posture, in rad (m), and holds them there until drives carry it.
    pub fn guide_to(&mut self, q: [f64; 6]) {
        self.guide = Some(Guide::new(*self.plant.q(), Joints::from(q)));
    }

    /// Sets whether the operator lays the arm down after all drives are off, as before each arming that requires it.
    pub const fn set_lays_down(&mut self, lays_down: bool) {
        self.lays_down = lays_down;
    }

    /// Begins to watch torque demands and motion.
    pub fn watch(&mut self) {
        self.extremes = Some(Extremes::new(*self.plant.q()));
    }

    /// Returns the extremes since [`watch`](Self::watch).
    pub const fn extremes(&self) -> Option<&Extremes> {
        self.extremes.as_ref()
    }

    /// Lays an arm down that was lifted out of its cradle, a reaction time after all drives are off.
    fn lay_down(&mut self, now: Instant) {
        let are_off = !self.drives.iter().any(Motor::is_enabled);
        self.off_since = self.off_since.or(Some(now)).filter(|_| are_off);
        let reacts = self.off_since.is_some_and(|since| now.since(since) >= LAYS_DOWN_AFTER);
        let Some(rest) = self.cradle.rest().copied() else { return };
        if reacts && self.lays_down && self.cradle.is_left() {
            self.guide = Some(Guide::new(*self.plant.q(), rest));
            self.cradle.renew();
        }
    }

    /// Sets the desired pose of the grip in {0} instead of the scenario's; `None` returns to the scenario's.
    pub const fn set_aim(&mut self, x_0_d: Option<Isometry3<f64>>) {
        self.aim = x_0_d;
    }

    /// Returns the pose of the grip at the start.
    pub const fn x_0_start(&self) -> &Isometry3<f64> {
        &self.x_0_start
    }

    /// Takes the oldest notice of the start or end of a fault.
    pub fn next_notice(&mut self) -> Option<Notice> {
        self.faults.next_notice()
    }

    /// Returns the state of the link to the commanded side.
    pub fn link(&self) -> Option<LinkFault> {
        self.faults.link()
    }

    /// Returns the time since which no drive demands torque; `None` while one does.
    pub const fn zero_torque_since(&self) -> Option<Instant> {
        self.zero_torque_since
    }

    /// Returns time zero of the scenario, after the first SYNC.
    pub const fn scenario_start(&self) -> Option<Instant> {
        self.start.zero()
    }

    /// Advances arm, operator and encoders to `now`.
    fn advance(&mut self, now: Instant) {
        // The arm does not catch up after a pause of the simulation.
        let dt = now.since(self.now).min(MAX_ADVANCE).as_secs_f64();
        if dt <= 0.0 {
            return;
        }
        let t = self.scenario_start().map_or(0.0, |begun| now.since(begun).as_secs_f64());
        let operator = self.scenario.operator(t);
        let x_0_script =
            self.aim.unwrap_or_else(|| self.scripted_pose(t - self.operator.reaction()));
        let felt = self.plant.f_g_hand();
        let grasp = self.operator.step(dt, &x_0_script, operator.is_holding, felt);
        let is_guided = self.guide.is_some();
        let is_pushed = self.is_carried();
        let hand = grasp.as_ref().map(|grasp| (&grasp.hand, &grasp.x_0_d));
        let hand = hand.filter(|_| !is_guided);
        for h in plant::steps(dt) {
            let support = self.cradle.step(is_pushed, self.plant.q(), self.plant.qd());
            let support = self.guided(h).unwrap_or(support);
            let tau = self.motors.step(h) + self.tau_push + support;
            self.plant.step(h, &tau, hand);
            self.motors.set_joint_motion(self.plant.q(), self.plant.qd());
        }
        self.extremes.iter_mut().for_each(|extremes| extremes.on_motion(self.plant.q()));
        let is_startled = self.operator.is_startled();
        let inputs = if is_startled { operator.hand_off() } else { operator.inputs };
        let inputs = self.faults.inputs(inputs);
        self.switches.iter_mut().for_each(|switches| {
            switches.set(inputs);
            switches.set_lever(operator.lever);
        });
        self.now = now;
        self.show();
    }

    /// Returns the torques of the hands on the links after `h` s, in N·m (N); `None` if no hand guides them.
    fn guided(&mut self, h: f64) -> Option<Joints> {
        let (q, qd) = (*self.plant.q(), *self.plant.qd());
        let acceleration = self.guide.as_mut()?.step(h, &self.plant.is_prismatic(), &q, &qd);
        Some(self.plant.torques_for(&acceleration))
    }

    /// Returns the pose of the grip in the script at `t` s.
    fn scripted_pose(&self, t: f64) -> Isometry3<f64> {
        let operator = self.scenario.operator(t);
        let place = self.x_0_start.translation.vector + operator.translation;
        let turned = self.x_0_start.rotation * operator.rotation;
        Isometry3::from_parts(Translation3::from(place), turned)
    }

    /// Advances the arm to `now` with the old demands, then applies changed ones.
    fn update_demands(&mut self, now: Instant) {
        let demands = self.drives.each_ref().map(Motor::demand);
        self.extremes.iter_mut().for_each(|extremes| extremes.on_demands(&demands));
        if demands.iter().any(|demand| demand.abs() > 0.0) {
            self.start.fix();
        }
        if self.is_carried() {
            self.guide = None;
        }
        self.lay_down(now);
        let mut pairs = demands.iter().zip(self.motors.demands());
        if pairs.any(|(new, old)| (new - old).abs() > 0.0) {
            self.advance(now);
            self.motors.set_demands(demands);
        }
        let is_zero_torque = demands.iter().all(|demand| demand.abs() < RESOLUTION);
        self.zero_torque_since = is_zero_torque.then(|| self.zero_torque_since.unwrap_or(now));
    }

    /// Returns whether drives carry the arm. A homing has one of them enabled.
    fn is_carried(&self) -> bool {
        let demands = self.drives.iter().map(Motor::demand);
        demands.filter(|demand| demand.abs() > 0.0).count() > 1
    }

    /// Updates each drive with its motor values.
    fn show(&mut self) {
        self.motors.set_joint_motion(self.plant.q(), self.plant.qd());
        let now = self.now;
        for (joint, (drive, sensed)) in
            Joint::each(self.drives.iter_mut().zip(self.motors.sensed()))
        {
            drive.sense(now, &self.faults.sensed(joint, sensed));
        }
    }
}

impl<M: Motor, I: Inputs> Station for World<M, I> {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if frame.cob_id == sync::COB_ID && channel == LEADING {
            if self.start.on_sync(now) {
                self.faults.begin(now);
            }
            self.advance(now);
        }
        if self.faults.is_idle() {
            self.drives.iter_mut().for_each(|drive| drive.on_frame(now, channel, frame, out));
            let switches = self.switches.iter_mut();
            switches.for_each(|switches| switches.on_frame(now, channel, frame, out));
        } else {
            let received = Telegram { channel, frame: *frame };
            let mut devices = devices(&mut self.drives, self.switches.as_mut());
            for (place, device) in present(&mut devices) {
                self.faults.deliver(now, place, device, received, out);
            }
        }
        self.update_demands(now);
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        if self.now + self.tick <= now {
            self.advance(now);
        }
        let is_due = |due: Option<Instant>| due.is_some_and(|due| due <= now);
        let mut devices = devices(&mut self.drives, self.switches.as_mut());
        if is_due(self.faults.deadline()) {
            self.start.fix();
            self.faults.on_time(now, &mut devices, out);
        }
        for (place, device) in present(&mut devices) {
            if is_due(device.deadline()) {
                self.faults.wake(now, place, device, out);
            }
        }
        self.update_demands(now);
    }

    fn deadline(&self) -> Option<Instant> {
        let drives = self.drives.iter().filter_map(Station::deadline);
        let switches = self.switches.as_ref().and_then(Station::deadline);
        let others = switches.into_iter().chain(self.faults.deadline());
        Some(drives.chain(others).fold(self.now + self.tick, Instant::min))
    }
}

/// Returns all devices, in order of their indices.
fn devices<'a, M: Motor, I: Inputs>(
    drives: &'a mut [M; 6],
    switches: Option<&'a mut I>,
) -> Devices<'a> {
    let [a, b, c, d, e, f] = drives;
    let switches = switches.map(|switches| -> &mut dyn Breakable { switches });
    [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), switches]
}

impl Motor for Drive {
    fn sense(&mut self, now: Instant, sensed: &MotorReading) {
        self.sense_at(now, sensed);
    }

    fn demand(&self) -> f64 {
        self.demand()
    }

    fn is_enabled(&self) -> bool {
        self.state() == State::OperationEnabled
    }
}

impl Inputs for SwitchBox {
    fn set(&mut self, inputs: u8) {
        self.set(inputs);
    }

    fn set_lever(&mut self, counts: i16) {
        self.set_lever(counts);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::actuator::ActuatorSettings;
    use crate::arm;
    use crate::drivetrain::DrivetrainSettings;
    use crate::fault::Direction;
    use crate::plant::Resistance;
    use faults::Service;
    use units::spatial::Wrench;

    const SCRIPT: &str = "seconds = 5\n\
        [[switch]]\nat_s = 0.5\ndeadman = true\n\
        [[move]]\nat_s = 1\nduration_s = 0.5\nto_m = [0, 0.03, 0]\n\
        [[hold]]\nat_s = 2.5\nholding = false\n";

    /// Moves with its joint, records its motion at each SYNC, and loses its torque at `trips`.
    #[derive(Clone, Debug, Default)]
    struct FakeMotor {
        torque: f64,
        trips: Option<Instant>,
        motion: (f64, f64),
        sampled: Vec<(f64, f64)>,
    }

    impl Station for FakeMotor {
        fn on_frame(&mut self, _: Instant, _: Channel, frame: &Frame, _: &mut Vec<Telegram>) {
            if frame.cob_id == sync::COB_ID {
                self.sampled.push(self.motion);
            }
        }

        fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {
            self.trips = None;
            self.torque = 0.0;
        }

        fn deadline(&self) -> Option<Instant> {
            self.trips
        }
    }

    impl Breakable for FakeMotor {
        fn send_emergency(&mut self, _: u16, _: u8) {}

        fn channel(&self) -> Channel {
            LEADING
        }

        fn cob_id(&self, _: Direction, _: Service) -> Option<u16> {
            None
        }

        fn switch_off(&mut self) {
            self.torque = 0.0;
        }

        fn switch_on(&mut self, _: Instant) {}
    }

    impl Motor for FakeMotor {
        fn sense(&mut self, _: Instant, sensed: &MotorReading) {
            self.motion = (sensed.position, sensed.velocity);
        }

        fn demand(&self) -> f64 {
            self.torque * PER_NEWTON_METRE
        }
    }

    #[derive(Clone, Debug, Default)]
    struct FakeSwitches(u8);

    impl Station for FakeSwitches {
        fn on_frame(&mut self, _: Instant, _: Channel, _: &Frame, _: &mut Vec<Telegram>) {}

        fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {}

        fn deadline(&self) -> Option<Instant> {
            None
        }
    }

    impl Breakable for FakeSwitches {
        fn send_emergency(&mut self, _: u16, _: u8) {}

        fn channel(&self) -> Channel {
            LEADING
        }

        fn cob_id(&self, _: Direction, _: Service) -> Option<u16> {
            None
        }

        fn switch_off(&mut self) {}

        fn switch_on(&mut self, _: Instant) {}
    }

    impl Inputs for FakeSwitches {
        fn set(&mut self, inputs: u8) {
            self.0 = inputs;
        }
    }

    /// Per mille of rated torque per newton metre.
    const PER_NEWTON_METRE: f64 = 100.0;

    const ACTUATOR: ActuatorSettings = ActuatorSettings {
        counts_per_rev: 4_096.0,
        gear_ratio: 1.0,
        zero_counts: 0,
        rated_torque: 1.0,
        torque_curve: [PER_NEWTON_METRE, 0.0, 0.0],
        max_torque: 100.0,
    };

    fn drivetrain() -> Drivetrain {
        Drivetrain::new(&DrivetrainSettings::ideal(ACTUATOR))
    }

    /// Returns the arm at neutral, with its weight balanced by the motors.
    fn world(seed: u64) -> World<FakeMotor, FakeSwitches> {
        scripted(seed, SCRIPT)
    }

    /// Returns the scripted world with this operator preset.
    fn with_preset(preset: &str) -> World<FakeMotor, FakeSwitches> {
        scripted(1, &format!("{SCRIPT}[hand]\npreset = \"{preset}\"\n"))
    }

    fn scripted(seed: u64, script: &str) -> World<FakeMotor, FakeSwitches> {
        let arm = arm::tests::kraft_like();
        let q = Joints::from([0.0, -0.873, 1.658, -0.785, 0.0, 0.0]);
        let weight = arm.gravity(&arm.posture(&q));
        let motors = std::array::from_fn(|joint| FakeMotor {
            torque: weight[joint],
            ..FakeMotor::default()
        });
        let resistance =
            [Resistance { coulomb: 0.001, stiction: 0.0, viscous: 0.005, range: [-3.0, 3.0] }; 6];
        let plant = Plant::new(arm, resistance, q);
        World::new(
            motors,
            [drivetrain(); 6],
            Some(FakeSwitches(0)),
            plant,
            Scenario::parse(script).unwrap(),
            seed,
        )
    }

    fn micros(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn sync(world: &mut World<FakeMotor, FakeSwitches>, at: Instant) {
        world.on_frame(at, LEADING, &Frame::new(sync::COB_ID, []), &mut Vec::new());
    }

    /// Sends one SYNC per millisecond, after `from` until `to`, in ms.
    fn run(world: &mut World<FakeMotor, FakeSwitches>, from: u64, to: u64) {
        (from + 1..=to).for_each(|ms| sync(world, micros(1_000 * ms)));
    }

    #[test]
    fn encoder_samples_the_joint_at_the_sync() {
        let mut world = world(1);
        world.drives[0].torque = 1.0;
        world.update_demands(Instant::ZERO);
        run(&mut world, 0, 20);
        for (joint, drive) in world.drives.iter().enumerate() {
            let now = (world.plant.q()[joint], world.plant.qd()[joint]);
            assert_eq!(drive.sampled.last(), Some(&now));
            assert_eq!(drive.sampled.len(), 20);
        }
        assert!(world.plant.q()[0] > 0.0 && world.plant.qd()[0] > 0.0);
    }

    #[test]
    fn torque_acts_until_the_drive_removes_it() {
        let speed_when_off_after = |trip: u64| {
            let mut world = world(1);
            world.drives[0].torque = 1.0;
            world.drives[0].trips = Some(micros(trip));
            world.update_demands(Instant::ZERO);
            assert_eq!(world.deadline(), Some(micros(trip)));
            world.on_time(micros(trip), &mut Vec::new());
            sync(&mut world, micros(1_000));
            world.plant.qd()[0]
        };
        let (early, late) = (speed_when_off_after(300), speed_when_off_after(900));
        assert!(early > 0.0, "it acted for 0.3 ms");
        assert!((late / early - 3.0).abs() < 0.3, "{late} rad/s and {early} rad/s");
    }

    #[test]
    fn backlash_in_every_joint_is_stable() {
        const PLAY: f64 = 0.01;
        let mut world = world(1);
        let good = DrivetrainSettings::ideal(ACTUATOR);
        let loose = DrivetrainSettings { backlash: PLAY, rotor_inertia: 0.001, ..good };
        world.motors = Motors::new([Drivetrain::new(&loose); 6]);
        world.update_demands(Instant::ZERO);
        let start = world.x_0_start.translation.vector;
        for ms in 0..900 {
            run(&mut world, ms, ms + 1);
            for (sensed, q) in world.motors.sensed().iter().zip(world.plant.q().iter()) {
                assert!((sensed.position - q).abs() <= PLAY / 2.0 + 1e-12, "at {ms} ms");
            }
        }
        let gone = world.plant.x_0_g().translation.vector - start;
        assert!(gone.norm() < 0.02 && world.plant.qd().amax() < 1.0, "{gone}");
    }

    #[test]
    fn arm_advances_without_sync() {
        let mut world = world(1);
        world.drives[0].torque = 1.0;
        world.update_demands(Instant::ZERO);
        for _ in 0..20 {
            let before = world.plant.q()[0];
            let due = world.deadline().unwrap();
            world.on_time(due, &mut Vec::new());
            assert!(world.plant.q()[0] > before, "at {due:?}");
        }
    }

    #[test]
    fn scenario_starts_at_the_first_sync_of_the_leading_bus() {
        let mut world = world(1);
        let frame = Frame::new(sync::COB_ID, []);
        world.on_frame(micros(100), Channel(1), &frame, &mut Vec::new());
        (1..1_000).for_each(|ms| world.on_time(micros(1_000 * ms), &mut Vec::new()));
        assert_eq!(world.switches.as_ref().unwrap().0, 0b10, "the deadman is open");
        run(&mut world, 1_000, 1_500);
        assert_eq!(world.switches.as_ref().unwrap().0, 0b10);
        run(&mut world, 1_500, 1_502);
        assert_eq!(
            world.switches.as_ref().unwrap().0,
            0b01,
            "half a second after the first SYNC it is closed"
        );
    }

    #[test]
    fn hand_moves_the_grip_and_releases_it() {
        let mut world = world(1);
        let start = world.x_0_start.translation.vector;
        run(&mut world, 0, 2_400);
        let moved = world.plant.x_0_g().translation.vector - start;
        assert!((moved - Vector3::new(0.0, 0.03, 0.0)).norm() < 4e-3, "{moved}");
        assert_ne!(*world.plant.f_g_hand(), Wrench::ZERO);
        run(&mut world, 2_400, 2_600);
        assert_eq!(*world.plant.f_g_hand(), Wrench::ZERO);
    }

    #[test]
    fn relaxed_operator_starts_late_and_steady_one_at_once() {
        let moved = |preset| {
            let mut world = with_preset(preset);
            let start = world.x_0_start.translation.vector.y;
            run(&mut world, 0, 1_200);
            world.plant.x_0_g().translation.vector.y - start
        };
        assert!(moved("steady") > 5e-3 && moved("relaxed") < 2e-3);
    }

    #[test]
    fn startled_operator_releases_grip_and_deadman() {
        let mut world = with_preset("nervous");
        run(&mut world, 0, 700);
        assert_eq!(world.switches.as_ref().unwrap().0, 0b01);
        assert_ne!(*world.plant.f_g_hand(), Wrench::ZERO);
        world.drives[0].torque = 8.0;
        world.update_demands(micros(700_000));
        run(&mut world, 700, 1_100);
        assert_eq!(*world.plant.f_g_hand(), Wrench::ZERO);
        assert_eq!(world.switches.as_ref().unwrap().0, 0b10);
    }

    #[test]
    fn seed_determines_the_world() {
        let end = |seed| {
            let mut world = world(seed);
            run(&mut world, 0, 200);
            *world.plant.q()
        };
        assert_eq!(end(1), end(1));
        assert_ne!(end(1), end(2));
    }

    #[test]
    fn paused_simulation_does_not_catch_up() {
        let end = |at| {
            let mut world = world(1);
            world.drives[0].torque = 1.0;
            world.update_demands(Instant::ZERO);
            world.on_time(at, &mut Vec::new());
            *world.plant.qd()
        };
        assert_eq!(end(micros(10_000_000)), end(Instant::ZERO + MAX_ADVANCE));
    }
}
