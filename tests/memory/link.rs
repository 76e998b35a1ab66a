//! Effects on the operator of a remote site that is lost, frozen, late or wrong: hazards 33 to 36.

use crate::common::bench::press_script;
use crate::common::prelude::*;
use faults::LinkFault;
use node::Node;
use node::reaction::Reaction;
use remote::site::VirtualSite;
use remote::{Command, Remote, RemoteSample};

/// Number of cycles of a run; the hand presses into the wall in most of them.
const CYCLES: usize = 1_200;

/// Remote site that counts its samples and passes them through a function, which may change or drop them.
struct Via<L> {
    site: VirtualSite,
    law: L,
    count: u64,
}

impl<L: FnMut(u64, RemoteSample) -> Option<RemoteSample>> Remote for Via<L> {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.count += 1;
        let sensed = self.site.exchange(now, command)?;
        (self.law)(self.count, sensed)
    }
}

type NodeWithRemote<L> = Node<Memory<World, ()>, Via<L>>;

/// Boots a node whose operator presses into the wall once it is armed; `law` changes its samples.
fn booted<L: FnMut(u64, RemoteSample) -> Option<RemoteSample>>(law: L) -> NodeWithRemote<L> {
    let text = fs::read_to_string(KRAFT).unwrap();
    let text = text.replace("start_m = [0.4,", "start_m = [0.5299,"); // 0.1 mm before the wall
    let config = parse(KRAFT, &text);
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let world = world::build(&config, script(&press_script(0.2)), 1);
    let remote = Via { site: VirtualSite::new(&config.remote, config.period), law, count: 0 };
    let mut node = Node::new(&config, Memory::new(&bitrates, world, ()), remote);
    node.bring_up(&mut || false).unwrap();
    node
}

/// Boots and arms a node as [`booted`] does.
fn pressing<L: FnMut(u64, RemoteSample) -> Option<RemoteSample>>(law: L) -> NodeWithRemote<L> {
    let mut node = booted(law);
    while node.cycle().inputs.is_none() {}
    node.request(Request::Arm, &mut || false).unwrap();
    node
}

/// Returns the targets and the command of each cycle.
fn run<L: FnMut(u64, RemoteSample) -> Option<RemoteSample>>(law: L) -> Vec<([i16; 6], Motion)> {
    let mut node = pressing(law);
    let records: Vec<_> = (0..CYCLES).map(|_| node.cycle()).collect();
    assert!(records.iter().any(|record| record.output.f_g_task.force.norm() > 1.0), "it is felt");
    records.iter().map(|record| (record.targets, record.output.command)).collect()
}

#[test]
fn hazard_33_invalid_wrench_equals_a_missing_one() {
    let poison = |count: u64, mut sensed: RemoteSample| {
        match count % 7 {
            0 => sensed.f_s = Wrench::from_components([f64::NAN; 6]),
            1 => sensed.f_s.moment.y = f64::INFINITY,
            2 => sensed.f_s.force.z = -1e9,
            3 => sensed.x_b_m.translation.x = f64::NAN,
            4 => sensed.at = sensed.at + Duration::from_secs(3_600),
            _ => {}
        }
        Some(sensed)
    };
    let lose = |count: u64, sensed: RemoteSample| (count % 7 > 4).then_some(sensed);
    assert!(run(poison) == run(lose));
}

#[test]
fn hazard_33_large_valid_wrench_is_bounded_by_cap_and_slew() {
    let config = config(KRAFT);
    let mut node = pressing(|count: u64, sensed: RemoteSample| {
        let sign = if count % 2_000 < 1_000 { 1.0 } else { -1.0 };
        Some(RemoteSample { f_s: Wrench::from_components([sign * 9e4; 6]), ..sensed })
    });
    let mut before = None;
    let mut most = 0.0_f64;
    for _ in 0..1_000 {
        let record = node.cycle();
        assert_eq!(record.cause, None);
        most = most.max(steepest(&config, &mut before, &record));
    }
    assert!((0.9..=1.0 + 1e-9).contains(&most), "{most} of the slew limit");
}

/// Returns the largest change of a torque since the last cycle, as a share of the slew limit (`torque_rise_s` = 20 ms).
fn steepest(config: &Config, before: &mut Option<[f64; 6]>, record: &Record) -> f64 {
    let tau: [f64; 6] = record.output.tau.into();
    let allowed = config.period.as_secs_f64() / 0.02;
    let joints = config.joints.iter().zip(tau).zip(before.replace(tau).unwrap_or(tau));
    let steep = joints.map(|((joint, now), last)| {
        assert!(now.abs() <= joint.plant.actuator.max_torque * (1.0 + 1e-12), "beyond capacity");
        (now - last).abs() / (joint.plant.actuator.max_torque * allowed)
    });
    steep.fold(0.0, f64::max)
}

#[test]
fn hazard_34_one_percent_sample_loss_never_stops_the_node() {
    let mut state = 1_u64;
    let mut node = pressing(|_: u64, sensed: RemoteSample| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (!(state >> 33).is_multiple_of(100)).then_some(sensed)
    });
    let engaged = (0..2_500).map(|_| node.cycle()).filter(|record| record.mode == Mode::Engaged);
    assert!(engaged.count() > 2_000);
    assert_eq!(node.cause(), None);
}

#[test]
fn hazard_36_late_or_repeated_samples_have_no_effect() {
    let mut kept = Vec::new();
    let shuffled = move |count: u64, sensed: RemoteSample| {
        kept.push(sensed);
        // Two cycles of five receive an old sample.
        Some(if count % 5 > 2 { kept[kept.len() * 2 / 3] } else { sensed })
    };
    let lose = |count: u64, sensed: RemoteSample| (count % 5 <= 2).then_some(sensed);
    assert!(run(shuffled) == run(lose));
}

#[test]
fn arming_is_refused_before_the_first_remote_sample() {
    let mut node = booted(|count: u64, sensed: RemoteSample| (count > 150).then_some(sensed));
    assert_eq!((node.mode(), node.cause()), (Mode::Ready, None), "it is no fault yet");
    let refused = node.request(Request::Arm, &mut || false).unwrap_err().to_string();
    assert_eq!(refused, "still active: no new wrench from the commanded side");
    while node.remote().count < 151 || node.cycle().inputs.is_none() {
        node.cycle();
    }
    // A cause counts as present for 20 ms after its last sighting.
    for _ in 0..25 {
        node.cycle();
    }
    assert_eq!(node.request(Request::Arm, &mut || false).unwrap(), Mode::Armed);
}

/// Plays a scenario whose link fails for 0.5 s from 1.0 s on, and checks the node's reaction and the reset.
fn link_fails_and_returns(name: &str, down: LinkFault) {
    let config = config(KRAFT);
    let mut bench = started(&config, scenario(&format!("faults/{name}")), ());
    let (mut before, mut fell_at, mut stopped_at) = (None, None, None);
    let (mut felt_for, mut felt_after_stop) = (Duration::ZERO, Duration::ZERO);
    while bench.elapsed() < Duration::from_millis(1_450) {
        let is_down = bench.world_mut().link() == Some(down);
        let record = bench.cycle();
        let steep = steepest(&config, &mut before, &record);
        if !is_down {
            assert_eq!(record.cause, None);
            continue;
        }
        let since = record.at.since(*fell_at.get_or_insert(record.at));
        if record.mode == Mode::ReflectionOff {
            stopped_at.get_or_insert(record.at);
        }
        assert!(steep <= 1.0 + 1e-9, "a step of {steep} times the slew");
        if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
            felt_for = since;
            felt_after_stop = stopped_at.map_or(Duration::ZERO, |at| record.at.since(at));
        }
    }
    let record = bench.cycle();
    assert_eq!((record.mode, record.cause), (Mode::ReflectionOff, Some(Cause::LinkLost)));
    assert_eq!(record.output.command, Motion::Hold);
    assert!(record.output.tau.amax() > 0.1, "gravity compensation goes on");
    // The last sample may have come a cycle before the first record without a link.
    let (least, most) = (Duration::from_millis(20) - config.period, Duration::from_millis(70));
    assert!((least..=most).contains(&felt_for), "{felt_for:?}");
    assert!(felt_after_stop <= Reaction::ReflectionOff.ramp(), "{felt_after_stop:?}");

    let refused = bench.ask(Request::Reset).unwrap_err().to_string();
    assert_eq!(refused, "still active: no new wrench from the commanded side");
    // A cause counts as present for 20 ms after its last sighting.
    while bench.elapsed() < Duration::from_millis(1_525) {
        assert_eq!(bench.cycle().mode, Mode::ReflectionOff, "it is latched");
    }
    assert_eq!(bench.ask(Request::Reset).unwrap(), Mode::Armed);
    let record = bench.cycle();
    assert_eq!((record.mode, record.cause), (Mode::Armed, None), "the deadman is still pressed");
    assert!(steepest(&config, &mut before, &record) <= 1.0 + 1e-9);
}

#[test]
fn hazard_34_lost_link_ends_reflection_within_70_ms() {
    link_fails_and_returns("link_loss", LinkFault::Lost);
}

#[test]
fn hazard_35_frozen_sample_ends_reflection_within_70_ms() {
    link_fails_and_returns("link_frozen", LinkFault::Frozen);
}

#[test]
fn hazard_37_answers_to_another_node_end_reflection() {
    link_fails_and_returns("link_foreign", LinkFault::Foreign);
}

#[test]
fn promise_07_lost_link_ends_reflection_in_70_ms_at_any_time() {
    let config = config(KRAFT);
    for cut in [600, 1_003, 1_517] {
        let mut node =
            pressing(move |count: u64, sensed: RemoteSample| (count < cut).then_some(sensed));
        let (mut before, mut cut_at, mut felt_for) = (None, Instant::ZERO, Duration::ZERO);
        for _ in 0..cut + 100 {
            let record = node.cycle();
            let steep = steepest(&config, &mut before, &record);
            if node.remote().count < cut {
                cut_at = record.at;
                continue;
            }
            assert!(steep <= 1.0 + 1e-9, "a step of {steep} times the slew");
            if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
                felt_for = record.at.since(cut_at);
            }
        }
        assert_eq!(node.cause(), Some(Cause::LinkLost));
        assert!(felt_for <= Duration::from_millis(70), "{felt_for:?}");
    }
}
