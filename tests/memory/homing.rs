//! Homings that end before their time, at each of their steps: what is left in the drives, and the way on. Judged by the
//! drives' own states, by torque demands and by the true posture.

use crate::common::prelude::*;
use crate::zero::{
    AT_REST, LARGEST_DEMAND, LARGEST_MOTION, errors, file_with, powered_up, run_for,
};
use node::{RequestError, zero::ZeroState};

/// Number of times within a homing at which each end is tried.
const STEPS: u32 = 12;

/// Arm in its cradle before its homing, watched.
struct Ready {
    config: Config,
    bench: Bench<Wire>,
    /// Maximum torque (6072h) of each drive.
    max_torques: [u32; 6],
    /// Duration of the whole homing.
    homing: Duration,
}

impl Ready {
    fn new(config: Config) -> Self {
        let (mut bench, _) = powered_up(&config);
        run_for(&mut bench, &config, AT_REST);
        bench.world_mut().watch();
        let max_torques = max_torques(&bench);
        let (mut whole, before) = (bench.clone(), bench.now());
        whole.ask(Request::Zero(None)).unwrap();
        let homing = whole.now().since(before);
        Self { config, bench, max_torques, homing }
    }

    /// Returns a bench for each step of the homing, and the time until then.
    fn steps(&self) -> impl Iterator<Item = (Bench<Wire>, Duration)> + '_ {
        (0..STEPS).map(|step| (self.bench.clone(), self.homing * step / STEPS))
    }

    /// Checks that a homing left no drive on, pushed and moved nothing, and that the arm is armed after a boot and `ctl zero`.
    fn ends_well(&self, mut bench: Bench<Wire>, at: Duration) {
        let enabled = |drive: &sim::drive::Drive| drive.state() == State::OperationEnabled;
        assert!(!bench.world().drives().iter().any(enabled), "{at:?}: a drive is on");
        let extremes = *bench.world().extremes().unwrap();
        assert!(extremes.demand <= LARGEST_DEMAND, "{at:?}: {} ‰", extremes.demand);
        assert!(extremes.motion < LARGEST_MOTION, "{at:?}: moved by {}", extremes.motion);
        let booted = match bench.node().cause() {
            None => bench.bring_up().map_err(|error| error.to_string()),
            Some(_) => bench.ask(Request::Reset).map(|_| ()).map_err(|error| error.to_string()),
        };
        booted.unwrap_or_else(|error| panic!("{at:?}: {error}"));
        let record = bench.cycle();
        assert_eq!(record.mode, Mode::Ready, "{at:?}");
        assert!(!record.zeros.contains(&ZeroState::Known), "{at:?}: {:?}", record.zeros);
        assert!(bench.world().drives().iter().all(|drive| drive.mode() == 10), "{at:?}");
        assert_eq!(max_torques(&bench), self.max_torques, "{at:?}");
        let refused = bench.ask(Request::Arm).unwrap_err();
        assert!(refused.to_string().contains("then `frhc ctl zero"), "{at:?}: {refused}");
        run_for(&mut bench, &self.config, AT_REST);
        bench.ask(Request::Zero(None)).unwrap_or_else(|error| panic!("{at:?}: {error}"));
        bench.ask(Request::Arm).unwrap_or_else(|error| panic!("{at:?}: {error}"));
    }
}

fn max_torques(bench: &Bench<Wire>) -> [u32; 6] {
    bench.world().drives().each_ref().map(|drive| drive.dictionary().unsigned(Object::MAX_TORQUE))
}

/// Lets this happen at a time after now.
fn after(bench: &mut Bench<Wire>, at: Duration, what: &str) {
    let at_s = (bench.elapsed() + at).as_secs_f64();
    bench.follow(
        script(&format!("seconds = 600\n{}\n", what.replace("AT", &format!("at_s = {at_s:.6}")))),
        1,
    );
}

#[test]
fn hazard_51_homing_ended_by_ctrl_c_leaves_drives_off() {
    let ready = Ready::new(file_with(KRAFT, "homing"));
    for (mut bench, at) in ready.steps() {
        let ended = bench.ask_within(Request::Zero(None), at).unwrap_err();
        assert!(matches!(ended, RequestError::Boot(_)), "{at:?}: {ended}");
        assert_eq!(bench.node().cause(), None, "{at:?}: an orderly end");
        bench.shut_down().unwrap_or_else(|error| panic!("{at:?}: {error}"));
        ready.ends_well(bench, at);
    }
}

#[test]
fn hazard_51_homing_ended_by_a_fault_leaves_drives_off() {
    let ready = Ready::new(file_with(KRAFT, "homing"));
    for fault in [
        "[[fault]]\nAT\njoint = 3\nkind = \"fault\"\ncode = 0x2310",
        "[[fault]]\nAT\njoint = 3\nkind = \"unplug\"\nfor_s = 0.5",
        "[[fault]]\nAT\nbus = 0\nkind = \"adapter_unplugged\"\nfor_s = 0.5",
        // As long as a kill lasts.
        "[[fault]]\nAT\nkind = \"process_stopped\"\nfor_s = 0.5",
    ] {
        let mut ended_by_it = 0;
        for (mut bench, at) in ready.steps() {
            after(&mut bench, at, fault);
            let Err(ended) = bench.ask(Request::Zero(None)) else {
                // A drive that was off may have been started again with a fault reset.
                let record = bench.cycle();
                assert_eq!(record.zeros, [ZeroState::Known; 6], "{at:?}: {fault}");
                assert!(errors(&mut bench).iter().all(|error| error.abs() < 0.01), "{at:?}");
                continue;
            };
            ended_by_it += 1;
            assert!(!bench.cycle().zeros.contains(&ZeroState::Known), "{at:?}: {ended}");
            run_for(&mut bench, &ready.config, 1_000);
            assert_eq!(bench.cycle().mode, Mode::DrivesOff, "{at:?}: {ended}");
            ready.ends_well(bench, at);
        }
        assert!(ended_by_it > STEPS / 2, "{fault}: {ended_by_it}");
    }
}

#[test]
fn hazard_51_deadman_pressed_during_a_homing_ends_it() {
    let ready = Ready::new(file_with(KRAFT, "homing"));
    let mut ended_by_it = 0;
    for (mut bench, at) in ready.steps() {
        after(&mut bench, at, "[[switch]]\nAT\ndeadman = true");
        let Err(ended) = bench.ask(Request::Zero(None)) else { continue };
        ended_by_it += 1;
        assert!(ended.to_string().contains("the deadman was pressed during the homing"), "{ended}");
        after(&mut bench, Duration::ZERO, "");
        run_for(&mut bench, &ready.config, 300);
        ready.ends_well(bench, at);
    }
    assert!(ended_by_it > STEPS / 2, "{ended_by_it}");
}

/// Returns the configuration with a bit that says that a drive knows its home, and drives that have it but `without`.
fn referenced(without: Option<Joint>) -> (Config, Bench<Wire>) {
    let homed = crate::common::zero::with_zero(KRAFT_TEXT, "homing");
    let config = parse(KRAFT, &in_each_joint(&homed, "referenced_bit = 15"));
    let mut script = script("seconds = 600\n");
    for joint in Joint::ALL.into_iter().filter(|joint| Some(*joint) != without) {
        script.quirks_mut().add(joint, ["referenced-bit".parse::<Quirk>().unwrap()]);
    }
    let mut bench = Bench::new(&config, script, 1, Wire::default());
    bench.bring_up().unwrap();
    run_for(&mut bench, &config, AT_REST);
    (config, bench)
}

#[test]
fn homed_drive_is_known_at_an_arming_in_rest() {
    let (config, mut bench) = referenced(None);
    let refused = bench.ask(Request::Arm).unwrap_err().to_string();
    assert!(refused.contains("joint 3 (elbow): zero unknown: not set"), "{refused}");
    bench.ask(Request::Zero(None)).unwrap();
    bench.ask(Request::Arm).unwrap();
    bench.shut_down().unwrap();
    // The drives stay on: their homes are kept, and the bit says so.
    bench.bring_up().unwrap();
    assert!(!bench.cycle().zeros.contains(&ZeroState::Known));
    run_for(&mut bench, &config, 1_000);
    bench.ask(Request::Arm).unwrap();
    assert_eq!(bench.cycle().zeros, [ZeroState::Known; 6]);
    assert!(errors(&mut bench)[2].abs() < 0.01);
    // A drive that has lost its power has lost its home, and does not say otherwise.
    after(&mut bench, 100 * MS, "[[fault]]\nAT\njoint = 3\nkind = \"reset\"");
    run_for(&mut bench, &config, 1_000);
    bench.ask(Request::Reset).unwrap();
    run_for(&mut bench, &config, 3_000);
    let refused = bench.ask(Request::Arm).unwrap_err().to_string();
    assert!(refused.contains("joint 3 (elbow): zero unknown"), "{refused}");
    assert!(!refused.contains("joint 2 (elevation)"), "{refused}");
}

#[test]
fn homing_without_the_bit_that_was_promised_is_named() {
    let (_, mut bench) = referenced(Some(ELBOW));
    let refused = bench.ask(Request::Zero(None)).unwrap_err().to_string();
    assert!(refused.starts_with("joint 3 (elbow): homing not attained in time"), "{refused}");
    assert!(refused.contains("referenced_bit"), "{refused}");
}
