//! One drive alone is tried: the steps of `frhc measure sign` at a node, on arms whose facts the configuration does not know.

use crate::common::prelude::*;
use measure::sign::{self, Verdict};
use node::trial::{End, Stage, TrialRequest, TrialStatus};
use sim::random::SplitMix;
use telemetry::trial_status::TrialReport;

/// No hand on the arm.
const HANDS_OFF: &str = "seconds = 4000\n[[hold]]\nat_s = 0.0\nholding = false\n";

/// Arms of three shapes.
const SHAPES: [&str; 3] = [KRAFT, JPL, SIXR];

/// Returns a shipped configuration with the deadman apart from the grip.
fn apart(file: &str) -> Config {
    let text = text(file).replace("\n[switches]\n", "\n[switches]\ndeadman_at = \"apart\"\n");
    parse(file, &text)
}

/// Returns the arm with masses 30 %, centres 2 cm, friction 50 %, torque curves 15 % off at most, and stiction up to 2.5 times
/// the friction.
fn unknown_arm(config: &Config, seed: u64) -> Config {
    let mut random = SplitMix::new(seed);
    config.clone().with_plant(|joint| {
        let mut within = |most: f64| most * (2.0 * random.unit() - 1.0);
        let link = &mut joint.link;
        link.mass *= 1.0 + within(0.3);
        link.centre_of_mass = link.centre_of_mass.map(|at| at + within(0.02) / 3.0_f64.sqrt());
        joint.friction.coulomb *= 1.0 + within(0.5);
        joint.friction.viscous *= 1.0 + within(0.5);
        let scale = 1.0 + within(0.15);
        joint.actuator.torque_curve = joint.actuator.torque_curve.map(|c| c * scale);
        joint.drivetrain.stiction = joint.friction.coulomb * 0.75 * (1.0 + within(1.0));
    })
}

/// Returns an arm whose gear turns the motor of one joint this many times as often as described, and whose torque has this sign.
fn driven(config: &Config, wrong: Joint, times: f64, sign: f64) -> Config {
    let mut joints = Joint::ALL.into_iter();
    config.clone().with_plant(|joint| {
        if joints.next() == Some(wrong) {
            let actuator = &mut joint.actuator;
            actuator.gear_ratio *= times;
            let [c1, c3, c5] = actuator.torque_curve.map(|c| c * sign);
            let [one, three, five] = [1, 3, 5].map(|power| times.powf(f64::from(power)));
            actuator.torque_curve = [c1 / one, c3 / three, c5 / five];
        }
    })
}

/// Arm whose drives are tried.
#[derive(Clone)]
struct Rig {
    bench: Bench<()>,
    /// Capacities of the joints, in ‰ of rated torque.
    capacities: [i16; 6],
}

fn rig(config: &Config, world: &Config) -> Rig {
    let mut bench = Bench::in_world_of(world, config, script(HANDS_OFF), 1, ());
    bench.bring_up().unwrap();
    bench.run(50);
    Rig { bench, capacities: config.joints.each_ref().map(|it| it.calibration.max_target().0) }
}

impl Rig {
    /// Lets this happen 20 ms from now.
    fn soon(&mut self, what: &str) {
        let at = format!("at_s = {:.3}", self.bench.elapsed().as_secs_f64() + 0.02);
        self.bench.follow(script(&format!("{HANDS_OFF}{}\n", what.replace("AT", &at))), 1);
    }

    fn press(&mut self, deadman: bool) {
        self.soon(&format!("[[switch]]\nAT\ndeadman = {deadman}"));
    }

    fn ask(&mut self, joint: Joint, share: u16) -> Result<Mode, String> {
        let request = Request::Trial(TrialRequest { joint, share });
        self.bench.ask(request).map_err(|error| error.to_string())
    }

    /// Checks at the drives themselves that one alone pushes, within its limit.
    fn check_bounds(&self, TrialRequest { joint, share }: TrialRequest) {
        let bound = i32::from(*joint.entry(&self.capacities)) * i32::from(share) / 1_000;
        for (other, drive) in Joint::each(self.bench.world().drives()) {
            let target = i32::from(drive.dictionary().i16(Object::TARGET_TORQUE));
            if other != joint {
                assert_eq!((target, drive.demand()), (0, 0.0), "joint {other}");
                continue;
            }
            assert!(target.abs() <= bound, "{target} beyond {bound}");
            let limit = drive.dictionary().optional(Object::MAX_TORQUE);
            let is_limited = limit.is_none_or(|limit| limit <= u32::try_from(bound).unwrap());
            assert!(drive.demand() == 0.0 || is_limited, "6072h is {limit:?}");
        }
    }

    /// Runs until a trial is in a stage that is wanted, or a stop.
    fn until(&mut self, is_wanted: impl Fn(Stage) -> bool) -> Record {
        for _ in 0..120_000 {
            let record = self.bench.cycle();
            let trial = record.trial.unwrap();
            self.check_bounds(trial.request);
            if is_wanted(trial.stage) || record.cause.is_some() {
                return record;
            }
        }
        panic!("not within two minutes")
    }

    /// Begins to try a drive; it waits for the deadman.
    fn begin(&mut self, joint: Joint, share: u16) {
        assert_eq!(self.ask(joint, share), Ok(Mode::Measuring));
        let waiting = self.until(|stage| stage == Stage::Waiting || has_ended(stage));
        assert_eq!(waiting.trial.unwrap().stage, Stage::Waiting);
    }

    /// Tries a drive within a bound, the deadman held.
    fn tried(&mut self, joint: Joint, share: u16) -> TrialStatus {
        self.begin(joint, share);
        self.press(true);
        let ended = self.until(has_ended);
        self.press(false);
        self.bench.run(100);
        ended.trial.unwrap()
    }
}

const fn has_ended(stage: Stage) -> bool {
    matches!(stage, Stage::Ended(_))
}

/// What `frhc measure sign` finds of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Found {
    Right,
    NotProven,
    Wrong,
}

/// Tries a joint with one bound after the other, or with the highest alone.
fn measured(rig: &mut Rig, config: &Config, joint: Joint, is_whole: bool) -> Found {
    let q = &rig.bench.cycle().output.q;
    let breakaway = sign::breakaway(config, joint, q);
    let mut bounds = sign::bounds(&breakaway);
    if !is_whole {
        bounds.drain(..bounds.len() - 1);
    }
    for share in &bounds {
        let (share, is_last) = (*share, bounds.last() == Some(share));
        let trial = rig.tried(joint, share);
        if trial.stage != Stage::Ended(End::Done) {
            println!("{joint}: {trial:?}");
            return Found::Wrong;
        }
        let parameters = joint.entry(&config.joints);
        match sign::judge(parameters, &breakaway, &TrialReport::new(&trial), is_last) {
            Verdict::Unclear => {}
            Verdict::Right => return Found::Right,
            verdict @ (Verdict::Reversed | Verdict::OtherTorque { .. }) => {
                println!("joint {joint}: {verdict:?} {breakaway:?}");
                return Found::Wrong;
            }
        }
    }
    println!("joint {joint}: not proven, {breakaway:?}");
    Found::NotProven
}

/// Measures all joints of an arm that lies at rest with all bounds, or one with the highest.
fn measure(config: &Config, world: &Config, joints: &[Joint]) -> Vec<Found> {
    let mut rig = rig(config, world);
    let is_whole = joints.len() > 1;
    let found = joints.iter().map(|joint| measured(&mut rig, config, *joint, is_whole)).collect();
    let limits = |bench: &Bench<()>| {
        bench.world().drives().each_ref().map(|it| it.dictionary().optional(Object::MAX_TORQUE))
    };
    assert_eq!(rig.bench.ask(Request::Reset).unwrap(), Mode::Ready);
    let fresh = self::rig(config, world);
    assert_eq!(limits(&rig.bench), limits(&fresh.bench), "the planned limits are in effect again");
    found
}

/// Returns a number of the environment.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// Measures one arm of three shapes, or those from `TRIAL_SEED` on, `TRIAL_ARMS` of each.
#[test]
fn signs_of_unknown_arms_are_proven() {
    let first = number("TRIAL_SEED").unwrap_or(0);
    let count = number("TRIAL_ARMS").unwrap_or(1);
    let mut not_proven = 0;
    for file in SHAPES {
        let config = apart(file);
        for seed in first..first + count {
            for (joint, found) in
                Joint::ALL.iter().zip(measure(&config, &unknown_arm(&config, seed), &Joint::ALL))
            {
                assert_ne!(found, Found::Wrong, "{file}, arm {seed}, joint {joint}");
                if found == Found::NotProven {
                    println!("{file}, arm {seed}, joint {joint}: not proven");
                    not_proven += 1;
                }
            }
        }
    }
    println!("{not_proven} of {} joints not proven", 18 * count);
    assert!(not_proven <= 18 * count / 100, "{not_proven} not proven");
}

#[test]
fn hazard_53_drive_that_turns_against_its_torque_is_found() {
    for file in SHAPES {
        let config = apart(file);
        for joint in Joint::ALL {
            let world = driven(&unknown_arm(&config, 1), joint, 1.0, -1.0);
            assert_eq!(measure(&config, &world, &[joint]), [Found::Wrong], "{file}, joint {joint}");
        }
    }
}

/// Measures joints whose gear is not the described one. None passes whose breakaway is known within a factor of three: not a joint
/// for which a wrong centre of mass may weigh more than its friction.
#[test]
fn hazard_53_gear_of_a_tenth_or_ten_times_passes_only_where_no_torque_is_known() {
    for file in SHAPES {
        let config = apart(file);
        for (joint, times) in Joint::ALL.into_iter().flat_map(|joint| [(joint, 0.1), (joint, 10.0)])
        {
            let world = driven(&unknown_arm(&config, 2), joint, times, 1.0);
            let mut rig = rig(&config, &world);
            // A rest position that is read wrong is refused before any torque.
            if rig.ask(joint, 1).is_err() {
                continue;
            }
            let breakaway = sign::breakaway(&config, joint, &rig.bench.cycle().output.q);
            let found = measure(&config, &world, &[joint]);
            println!("{file}, joint {joint}, {times}: {found:?}");
            let is_known = breakaway.centres <= breakaway.friction.max(breakaway.weight.abs());
            assert!(!is_known || found != [Found::Right], "{file}, joint {joint}, {times}");
        }
    }
}

/// Joint that is tried where any would do, and a bound that moves it.
const ELBOW: (Joint, u16) = (Joint::of::<3>(), 500);

/// An arm whose elbow is being pushed.
fn pushed() -> Rig {
    let config = apart(KRAFT);
    let mut rig = rig(&config, &config);
    let (joint, share) = ELBOW;
    rig.begin(joint, share);
    rig.press(true);
    rig.until(|stage| stage == Stage::Pushing);
    for _ in 0..2_000 {
        rig.until(|_| true);
    }
    assert!(rig.bench.world().torques().abs().max() > 0.1, "it is pushed");
    rig
}

impl Rig {
    /// Checks that all drives are off or going off, and that a reset leads to the planned limits.
    fn ends_well(mut self) {
        self.bench.run(20);
        let is_on = |drive: &sim::drive::Drive| drive.state() == State::OperationEnabled;
        assert!(!self.bench.world().drives().iter().any(is_on));
        assert!(self.bench.world().torques().abs().max() < 1e-9);
        // A fault is over by then.
        self.bench.run(2_000);
        self.press(false);
        self.bench.run(100);
        assert_eq!(self.bench.ask(Request::Reset).unwrap(), Mode::Ready);
        for (capacity, drive) in self.capacities.iter().zip(self.bench.world().drives()) {
            let limit = drive.dictionary().unsigned(Object::MAX_TORQUE);
            assert_eq!(i64::from(limit), i64::from(*capacity));
        }
    }
}

#[test]
fn hazard_53_released_deadman_ends_the_push_at_once_and_the_next_trial_may_follow() {
    let mut rig = pushed();
    rig.press(false);
    rig.bench.run(25);
    assert!(rig.bench.world().torques().abs().max() < 1e-9);
    let record = rig.until(has_ended);
    let trial = record.trial.unwrap();
    assert_eq!((trial.stage, record.mode), (Stage::Ended(End::LetGo), Mode::Measuring));
    rig.bench.run(200);
    let (joint, share) = ELBOW;
    assert_eq!(rig.tried(joint, share).stage, Stage::Ended(End::Done));
    rig.ends_well();
}

#[test]
fn hazard_53_disarm_leaves_drives_off_until_a_boot() {
    let mut rig = pushed();
    assert_eq!(rig.bench.ask(Request::Disarm).unwrap(), Mode::DrivesOff);
    let record = rig.bench.cycle();
    let cause = record.cause.map(|cause| cause.to_string()).unwrap();
    assert!(cause.starts_with("joint 3: torque limit still reduced after a trial"), "{cause}");
    assert!(rig.bench.ask(Request::Arm).is_err());
    rig.ends_well();
}

#[test]
fn hazard_53_ctrl_c_in_a_push_is_an_orderly_end() {
    let mut rig = pushed();
    rig.bench.shut_down().unwrap();
    assert_eq!(rig.bench.node().cause(), None);
    let is_on = |drive: &sim::drive::Drive| drive.state() == State::OperationEnabled;
    assert!(!rig.bench.world().drives().iter().any(is_on));
    rig.bench.bring_up().unwrap();
    let limit = rig.bench.world().drives()[2].dictionary().unsigned(Object::MAX_TORQUE);
    assert_eq!(i64::from(limit), i64::from(rig.capacities[2]), "the planned one");
}

#[test]
fn hazard_53_fault_in_a_push_switches_all_drives_off() {
    for (fault, ms) in [
        ("joint = 3\nkind = \"fault\"\ncode = 0x2310", 40),
        ("joint = 3\nkind = \"unplug\"\nfor_s = 0.5", 60),
        ("joint = 5\nkind = \"fault\"\ncode = 0x2310", 40),
        ("kind = \"process_stopped\"\nfor_s = 0.5", 600),
        ("bus = 0\nkind = \"adapter_unplugged\"\nfor_s = 0.5", 60),
    ] {
        let mut rig = pushed();
        rig.soon(&format!("[[switch]]\nat_s = 0.0\ndeadman = true\n[[fault]]\nAT\n{fault}"));
        for _ in 0..ms {
            rig.bench.cycle();
        }
        let record = rig.bench.cycle();
        assert_eq!(record.mode, Mode::DrivesOff, "{fault}: {:?}", record.cause);
        assert!(rig.bench.world().torques().abs().max() < 1e-9, "{fault}");
        assert_eq!(record.trial.map(|trial| has_ended(trial.stage)), Some(true), "{fault}");
        rig.ends_well();
    }
}

#[test]
fn trial_is_refused_where_it_must_not_begin() {
    let (joint, share) = ELBOW;
    let shipped = config(KRAFT);
    let refused = rig(&shipped, &shipped).ask(joint, share).unwrap_err();
    assert!(refused.starts_with("the deadman is at the grip"), "{refused}");
    assert!(refused.ends_with("set switches.deadman_at = \"apart\""), "{refused}");

    let config = apart(KRAFT);
    let mut rig = rig(&config, &config);
    let beyond = rig.ask(joint, 1_000).unwrap_err();
    assert!(
        beyond.starts_with("joint 3: a bound of 1000 ‰ of its capacity is beyond "),
        "{beyond}"
    );
    assert!(rig.ask(joint, 0).is_err());
    rig.press(true);
    rig.bench.run(60);
    assert_eq!(rig.ask(joint, share).unwrap_err(), "the deadman is closed: release it first");
    rig.press(false);
    rig.bench.run(60);
    rig.begin(joint, share);
    let busy = rig.ask(joint, share).unwrap_err();
    assert!(busy.starts_with("joint 3: its drive is being tried"), "{busy}");
    assert_eq!(
        rig.bench.ask(Request::Arm).unwrap_err().to_string(),
        "a drive was tried: its torque limit is reduced. Run `frhc ctl reset` first"
    );
    assert!(rig.bench.ask(Request::Park).is_err() && rig.bench.ask(Request::Zero(None)).is_err());

    let away = config.clone().with_start([0.0, -0.5, 1.5, -0.8, 0.0, 0.0]);
    let away = self::rig(&config, &away).ask(joint, share).unwrap_err();
    assert!(away.contains("joint 2 (elevation): reads -28.6°, rest_deg is -50"), "{away}");
    let armed = {
        let mut rig = self::rig(&config, &config);
        rig.bench.ask(Request::Arm).unwrap();
        rig.ask(joint, share).unwrap_err()
    };
    assert_eq!(armed, "not ready: the node is armed");
}
