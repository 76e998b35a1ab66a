//! Stops from every mode and at any moment of a boot: order of the frames, and no drive left on.

use crate::common::prelude::*;
use bus::Tap;
use canopen::NmtState;
use node::{BringUpError, Node, PowerOffError};
use remote::site::VirtualSite;

/// Maximum time from the stop request to the last frame.
const STOP_LIMIT: Duration = Duration::from_secs(1);

/// The operator arms, engages and moves the hand.
const MOVES: &str = "seconds = 5\n[[console]]\nat_s = 0.05\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.1\ndeadman = true\n\
    [[move]]\nat_s = 0.15\nduration_s = 0.3\nto_m = [0.04, 0.0, 0.0]\n";

/// The operator moves the armed arm, and lets it park.
const PARKS: &str = "seconds = 5\n[[console]]\nat_s = 0.05\nrequest = \"arm\"\n\
    [[move]]\nat_s = 0.15\nduration_s = 0.8\nto_m = [0.04, 0.0, 0.0]\n\
    [[console]]\nat_s = 1.2\nrequest = \"park\"\n\
    [[switch]]\nat_s = 1.3\ndeadman = true\n[[hold]]\nat_s = 1.4\nholding = false\n";

/// Returns a bench with a scenario, booted.
fn follows(text: &str) -> (Bench<Wire>, Wire) {
    let wire = Wire::default();
    (started(&config(KRAFT), script(text), wire.clone()), wire)
}

fn moving() -> (Bench<Wire>, Wire) {
    follows(MOVES)
}

/// Returns whether the frame has target torques: RPDO1 of a group of three drives.
fn is_torque(frame: &Frame) -> bool {
    [0x201, 0x204].contains(&frame.cob_id)
}

/// Stops the node and checks the order of its frames: zero torque, disable voltage, pre-operational, and no other
/// controlword.
fn stops_in_order(bench: &mut Bench<Wire>, wire: &Wire) {
    wire.clear();
    let requested = bench.node().bus().now();
    bench.shut_down().unwrap();
    let took = bench.node().bus().now().since(requested);
    assert!(took <= STOP_LIMIT, "{took:?}");
    every_drive_is_off(bench);

    // Gravity compensation ramps to zero in 50 ms; a frame may have to wait for the next cycle.
    let ramped_down = requested + Duration::from_millis(52);
    let frames = wire.all();
    let late =
        frames.iter().filter(|(at, _)| *at > ramped_down).map(|(_, telegram)| telegram.frame);
    assert!(late.filter(is_torque).all(|frame| frame.data() == [0; 6]));
    let mut torques = frames.iter().map(|(_, telegram)| telegram.frame).filter(is_torque);
    assert_eq!(torques.next_back().unwrap().data(), [0; 6]);
    let frames = frames.into_iter().map(|(_, telegram)| telegram.frame);
    // Frames before the next SYNC were queued before the request.
    let frames: Vec<Frame> = frames.skip_while(|frame| frame.cob_id != 0x80).collect();
    let is_word = |frame: &Frame| (0x301..=0x306).contains(&frame.cob_id);
    let first = |what: &dyn Fn(&Frame) -> bool| frames.iter().position(what).unwrap();
    let pre_operational = first(&|frame| frame.cob_id == 0 && frame.data()[0] == 0x80);
    assert!(first(&is_torque) < pre_operational);
    for word in frames.iter().filter(|frame| is_word(frame)) {
        assert!([[0, 0], [0x80, 0]].contains(&word.data().try_into().unwrap()), "{word}");
    }
    let last_word = frames.iter().rposition(is_word);
    assert!(last_word.is_none_or(|last| first(&is_torque) < last && last < pre_operational));
    assert!(!frames[pre_operational..].iter().any(is_torque));
}

fn every_drive_is_off(bench: &Bench<Wire>) {
    for drive in bench.node().bus().stations().drives() {
        assert_eq!(drive.demand(), 0.0);
        let off = [State::SwitchOnDisabled, State::Fault];
        assert!(off.contains(&drive.state()), "{:?}", drive.state());
        assert_eq!(drive.nmt_state(), NmtState::PreOperational);
    }
}

#[test]
fn hazard_30_stop_is_orderly_within_a_second_from_every_mode() {
    for mode in Mode::ALL.into_iter().filter(|mode| *mode != Mode::Boot) {
        let (mut bench, wire) = follows(if mode == Mode::Measuring { PARKS } else { MOVES });
        match mode {
            Mode::Boot | Mode::Ready => {}
            Mode::Measuring => {
                let moves =
                    |record: &Record| record.output.hold.is_some_and(|hold| hold.done > 0.1);
                until(&mut bench, moves);
            }
            Mode::Armed | Mode::Engaged => {
                until(&mut bench, |record| record.mode == mode);
            }
            Mode::ReflectionOff | Mode::ZeroTorque | Mode::DrivesOff => {
                until(&mut bench, |record| record.mode == Mode::Engaged);
                bench.world_mut().drive_mut(Joint::of::<2>()).unwrap().fail();
                until(&mut bench, |record| record.mode.is_stopped());
                bench.run(if mode == Mode::DrivesOff { 200 } else { 1 });
            }
        }
        stops_in_order(&mut bench, &wire);
    }
}

#[test]
fn hazard_30_orderly_stop_ramps_torque_down_in_50_ms() {
    let (mut bench, wire) = moving();
    until(&mut bench, |record| record.mode == Mode::Engaged);
    // Gravity compensation has come on over 1 s.
    bench.run(1_100);
    let requested = bench.node().bus().now();
    wire.clear();
    bench.shut_down().unwrap();
    // The elbow's target is the third of the first group.
    let targets = wire.all().into_iter().filter(|(_, telegram)| telegram.frame.cob_id == 0x201);
    let elbow = targets.map(|(at, telegram)| {
        let target = i16::from_le_bytes(telegram.frame.data()[4..6].try_into().unwrap());
        (at.since(requested), target.abs())
    });
    let at = |ms: u32| elbow.clone().find(|(since, _)| *since >= MS * ms).unwrap().1;
    assert!(at(0) > 30, "{}", at(0));
    assert!((at(0) / 4..at(0)).contains(&at(25)), "{} to {} in 25 ms", at(0), at(25));
    assert_eq!(at(52), 0);
}

#[test]
fn promise_12_stop_is_orderly_at_any_moment_of_a_movement() {
    for cycles in (0..7).map(|step| 53 * step) {
        let (mut bench, wire) = moving();
        until(&mut bench, |record| record.mode == Mode::Engaged);
        bench.run(cycles);
        stops_in_order(&mut bench, &wire);
    }
}

#[test]
fn promise_12_unconfirmed_drive_is_named_within_a_second() {
    let (mut bench, _) = moving();
    until(&mut bench, |record| record.mode == Mode::Engaged);
    bench.world_mut().drive_mut(Joint::of::<4>()).unwrap().unplug();
    let requested = bench.node().bus().now();
    let on = bench.shut_down().unwrap_err().statuswords.map(|word| word.is_some());
    assert_eq!(on, [false, false, false, true, false, false]);
    assert!(bench.node().bus().now().since(requested) <= STOP_LIMIT);
}

#[test]
fn hazard_30_orderly_stop_leaves_no_drive_in_fault() {
    for deadman in [false, true] {
        let (mut bench, wire) = moving();
        if deadman {
            until(&mut bench, |record| record.mode == Mode::Engaged);
        }
        bench.shut_down().unwrap();
        let ended = bench.now();
        // Longer than any watchdog: the process is gone.
        bench.fall_silent_for(Duration::from_secs(1));
        for drive in bench.node().bus().stations().drives() {
            assert_eq!(drive.state(), State::SwitchOnDisabled);
        }
        for node in 1..=6 {
            let emergencies = wire.since(ended, 0x680 + node);
            assert!(emergencies.is_empty(), "{emergencies:?}");
        }
        bench.bring_up().unwrap();
        assert!(bench.node().proof_test_report().drives.iter().all(|it| it.heartbeat.is_some()));
    }
}

#[test]
fn hazard_30_unconfirmed_drive_leaves_all_watchdogs_on() {
    let (mut bench, wire) = moving();
    until(&mut bench, |record| record.mode == Mode::Engaged);
    bench.world_mut().drive_mut(Joint::of::<4>()).unwrap().unplug();
    let requested = bench.now();
    let error = bench.shut_down().unwrap_err();
    assert!(error.to_string().contains("all drives keep their watchdogs"), "{error}");
    for node in 1..=6 {
        let writes = wire.since(requested, 0x600 + node);
        let consumer = writes.iter().filter(|(_, frame)| frame.data()[1..4] == [0x16, 0x10, 1]);
        assert_eq!(consumer.count(), 0, "node {node}");
    }
    bench.fall_silent_for(Duration::from_secs(1));
    for (at, drive) in bench.node().bus().stations().drives().iter().enumerate() {
        assert!(at == 3 || drive.state() == State::Fault, "joint {}: {:?}", at + 1, drive.state());
    }
}

#[test]
fn hazard_30_urgent_stop_confirms_power_off_alone() {
    let config = config(KRAFT);
    let wire = Wire::default();
    let mut node = node(&config, wire.clone());
    node.bring_up(&mut || false).unwrap();
    wire.clear();
    node.shut_down(&mut || true).unwrap();
    let written = wire.all().into_iter().map(|(_, telegram)| telegram.frame.cob_id);
    assert!(!written.into_iter().any(|cob_id| (0x601..=0x606).contains(&cob_id)));
    assert!(node.is_off());
}

/// Returns a node with a simulated world, outside of a bench.
pub(crate) fn node<T: Tap>(config: &Config, tap: T) -> Node<Memory<World, T>, VirtualSite> {
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let world = world::build(config, script("seconds = 5"), 1);
    Node::new(
        config,
        Memory::new(&bitrates, world, tap),
        VirtualSite::new(&config.remote, config.period),
    )
}

/// Returns a predicate that is true from call `n + 1` on.
pub(crate) fn after(n: u32) -> impl FnMut() -> bool {
    let mut calls = 0;
    move || {
        calls += 1;
        calls > n
    }
}

#[test]
fn promise_12_boot_cancelled_at_any_moment_leaves_no_drive_on() {
    let config = config(KRAFT);
    let (mut n, mut cancelled) = (0, 0);
    loop {
        let mut node = node(&config, ());
        let begun = node.bus().now();
        let booted = node.bring_up(&mut after(n));
        let took = node.bus().now().since(begun);
        match booted {
            Ok(()) => break,
            Err(error) => assert!(matches!(error, BringUpError::GivenUp), "{error}"),
        }
        cancelled += 1;
        for drive in node.bus().stations().drives() {
            let state = drive.state();
            assert!(state != State::OperationEnabled && drive.demand() == 0.0, "{n}: {state:?}");
            assert_ne!(drive.nmt_state(), NmtState::Operational, "{n}");
        }
        // The whole boot takes some seconds; a cancelled one must not take longer.
        assert!(took < Duration::from_secs(10), "{took:?}");
        n += 1 + n / 2;
    }
    assert!(cancelled > 8, "{cancelled}");
}

#[test]
fn promise_12_boot_polls_for_cancellation_every_50_ms() {
    // Long timeouts of the drives: the proof test stops SYNC or heartbeat for their whole duration.
    let text = fs::read_to_string(KRAFT).unwrap();
    let slow = text.replace("node_lost_ms = 22 ", "node_lost_ms = 200 ");
    assert_ne!(slow, text);
    let config = parse(KRAFT, &slow);
    let wire = Wire::default();
    let mut node = node(&config, wire.clone());
    let (mut polled, mut longest, mut polls) = (Instant::ZERO, Duration::ZERO, 0);
    let mut give_up = || {
        // The frames are its clock: in the silence before the resets the polls share the time between two of them.
        polls += 1;
        if let Some((now, _)) = wire.all().last() {
            longest = longest.max(now.since(polled) / polls);
            (polled, polls) = (*now, 0);
        }
        wire.clear();
        false
    };
    node.bring_up(&mut give_up).unwrap();
    assert!(longest <= Duration::from_millis(55), "{longest:?}");
}

#[test]
fn promise_12_reset_with_a_boot_can_be_cancelled() {
    let config = config(KRAFT);
    let mut node = node(&config, ());
    node.bring_up(&mut || false).unwrap();
    // A lost drive requires a boot; the drive is plugged in again.
    node.bus_mut().stations_mut().drive_mut(Joint::of::<3>()).unwrap().unplug();
    while !node.cycle().mode.is_stopped() {}
    node.bus_mut().stations_mut().drive_mut(Joint::of::<3>()).unwrap().plug();
    let requested = node.bus().now();
    let refused = node.request(Request::Reset, &mut after(2)).unwrap_err();
    assert_eq!(refused.to_string(), "boot given up");
    assert!(node.mode().is_stopped(), "latched as before");
    // No statusword of that drive was received since it was unplugged.
    let PowerOffError { statuswords } = node.shut_down(&mut || false).unwrap_err();
    let named = statuswords.map(|statusword| statusword.is_some());
    assert_eq!(named, [false, false, true, false, false, false]);
    assert!(node.bus().now().since(requested) <= STOP_LIMIT);
}
