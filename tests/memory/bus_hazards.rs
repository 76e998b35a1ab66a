//! The hazards of the bus, the adapter and the host (rows 21 to 26, 28, 29 and 31): what the node does of
//! each, at whatever phase of a cycle it comes, and when the drives are without torque.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::time::Duration;

use proptest::prelude::*;

use crate::common::bench::Wire;
use crate::common::bench::config;
use bus::Bus;
use bus::BusFault;
use bus::Disturbance;
use bus::HostFault;
use canopen::frame::Channel;
use canopen::frame::Frame;
use lab::bench::Bench;
use node::Request;
use node::cause::Kind;
use node::record::Mode;
use node::record::Record;
use sim::scenario::Scenario;
use units::time::Instant;

const KRAFT: &str = "config/kraft_like.toml";

const BUS: Channel = Channel(0);

/// Within one cycle of 1 ms: while SYNC passes, and after the torques are sent. A campaign tries all.
const PHASES: [u64; 2] = [20, 600];

/// Somebody holds the arm, which is armed and engaged, and goes on moving it.
const SCRIPT: &str = "seconds = 60\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.2\ndeadman = true\n\
    [[move]]\nat_s = 0.25\nduration_s = 1.0\nto_m = [0.0, 0.05, 0.0]\n";

/// Cycles until the weight is taken up and the hand is on its way.
const SETTLED: u64 = 400;

/// The drives' own timers end their torque within 6 ms after the last that they were told; it is looked at
/// once in a cycle of 1 ms.
const BY_TIMER: Duration = Duration::from_millis(7);

/// A run with something going wrong in it.
struct Run {
    bench: Bench<Wire>,
    wire: Wire,
    onset: Instant,
    records: Vec<Record>,
    /// When a drive last had torque, of the moments between two cycles.
    pushed: Instant,
}

impl Run {
    /// Runs until the arm is held, and plans `host_faults` for so many µs after the next SYNC is due.
    fn with(host_faults: &[(u64, HostFault)]) -> Self {
        let (config, wire) = (config(KRAFT), Wire::default());
        let script = Scenario::parse(SCRIPT).unwrap();
        let mut bench = Bench::new(&config, script, 1, false, wire.clone());
        bench.bring_up().unwrap();
        bench.run(SETTLED);
        let last = bench.cycle();
        assert_eq!(last.mode, Mode::Engaged);
        let due = last.at + config.period;
        for (micros, host_fault) in host_faults {
            bench.bus_mut().plan(due + Duration::from_micros(*micros), *host_fault);
        }
        let onset =
            due + Duration::from_micros(host_faults.first().map_or(0, |(micros, _)| *micros));
        Self { bench, wire, onset, records: Vec::new(), pushed: onset }
    }

    fn cycles(mut self, cycles: usize) -> Self {
        for _ in 0..cycles {
            self.records.push(self.bench.cycle());
            let torques = self.bench.world_mut().torques();
            if torques.iter().any(|torque| torque.abs() > 0.02) {
                self.pushed = self.bench.node().bus().now();
            }
        }
        self
    }

    /// What stopped it, and its mode at the end.
    fn end(&self) -> (Option<Kind>, Mode) {
        let last = self.records.last().unwrap();
        (last.cause.map(|cause| cause.kind()), last.mode)
    }

    /// When the first cycle ended whose torques are all zero and remain so, in µs after the onset.
    fn told(&self) -> u64 {
        let pushing = self.records.iter().rposition(|record| record.targets != [0; 6]);
        let first = &self.records[pushing.map_or(0, |place| place + 1)];
        micros(self.onset, first.at)
    }

    /// When SYNC was complete on the bus since the onset, in µs after it.
    fn syncs(&self) -> Vec<u64> {
        let syncs = self.wire.since(self.onset, 0x080).into_iter();
        let all = self.wire.all();
        let on_bus = |at: Instant| {
            let is_it = |(when, telegram): &(Instant, canopen::frame::Telegram)| {
                *when == at && telegram.channel == BUS && telegram.frame.cob_id == 0x080
            };
            all.iter().any(is_it)
        };
        syncs.map(|(at, _)| at).filter(|at| on_bus(*at)).map(|at| micros(self.onset, at)).collect()
    }

    /// When the node last sent anything on the bus, in µs after the onset.
    fn last_sent(&self) -> u64 {
        let all = self.wire.all();
        let is_ours =
            |cob_id: u16| matches!(cob_id, 0x000 | 0x080 | 0x200..0x580 | 0x600..0x680 | 0x77F);
        let last = all.iter().rfind(|(_, telegram)| {
            telegram.channel == BUS
                && is_ours(telegram.frame.cob_id)
                && !matches!(telegram.frame.cob_id, 0x281..0x2A0 | 0x381..0x3A0)
        });
        micros(self.onset, last.unwrap().0)
    }
}

fn micros(from: Instant, to: Instant) -> u64 {
    u64::try_from(to.since(from).as_micros()).unwrap()
}

fn on_bus(wrong: Disturbance) -> HostFault {
    HostFault::Bus(BUS, Some(wrong))
}

/// `wrong` on one bus at every phase: the drives are switched off for one of `kinds`, those that are still
/// reached are told zero within `cycles`, nothing more is sent on that bus, and no drive pushes when its
/// timer is over. Where the drives' answers stop in the middle of a cycle, they may be missed first.
fn ends_sending(wrong: Disturbance, kinds: &[Kind], cycles: u64) {
    for phase in PHASES {
        let run = Run::with(&[(phase, on_bus(wrong))]).cycles(30);
        let (cause, mode) = run.end();
        assert!(kinds.contains(&cause.unwrap()), "{wrong:?} at {phase} µs: {cause:?}");
        assert_eq!(mode, Mode::DrivesOff, "{wrong:?} at {phase} µs");
        assert!(run.told() <= cycles * 1_000, "{wrong:?} at {phase} µs: {} µs", run.told());
        assert!(run.last_sent() <= cycles * 1_000, "{wrong:?} at {phase}: {}", run.last_sent());
        let pushed = run.pushed.since(run.onset + Duration::from_micros(run.last_sent()));
        assert!(pushed <= BY_TIMER, "{wrong:?} at {phase} µs: pushed for {pushed:?}");
    }
}

#[test]
fn hazard_21_a_full_queue_is_zero_torque_and_a_second_cycle_of_it_ends_all_sending() {
    ends_sending(Disturbance::Full, &[Kind::QueueFull], 3);
}

#[test]
fn hazard_22_frames_that_are_taken_and_not_sent_end_all_sending() {
    ends_sending(Disturbance::Stuck, &[Kind::EchoMissing, Kind::SamplesMissing], 4);
}

#[test]
fn hazard_23_bus_off_ends_all_sending_within_a_cycle() {
    ends_sending(Disturbance::Fault(BusFault::Off), &[Kind::BusOff], 2);
}

#[test]
fn hazard_23_error_passive_is_zero_torque_and_a_warning_is_nothing() {
    for phase in PHASES {
        let passive = on_bus(Disturbance::Fault(BusFault::Passive));
        let run = Run::with(&[(phase, passive)]).cycles(30);
        assert_eq!(run.end(), (Some(Kind::BusPassive), Mode::ZeroTorque));
        assert!(run.told() <= 2_000 && run.last_sent() > 28_000, "{phase}");
        let warning = on_bus(Disturbance::Fault(BusFault::Warning));
        let run = Run::with(&[(phase, warning)]).cycles(30);
        assert_eq!(run.end(), (None, Mode::Engaged));
    }
}

#[test]
fn hazard_24_an_interface_that_goes_down_ends_all_sending() {
    ends_sending(Disturbance::Fault(BusFault::Down), &[Kind::BusDown], 2);
    ends_sending(Disturbance::Down, &[Kind::BusDown], 2);
}

#[test]
fn hazard_22_what_a_stalled_adapter_sends_at_last_meets_no_sync() {
    for (phase, stalls) in [(20, 3_000), (250, 4_400), (600, 8_000)] {
        let heal = (phase + stalls, HostFault::Bus(BUS, None));
        let run = Run::with(&[(phase, on_bus(Disturbance::Stalled)), heal]).cycles(60);
        assert_eq!(run.end().1, Mode::DrivesOff, "{phase}");
        // The one under way when it began, and the one that was held.
        let syncs = run.syncs();
        assert!(syncs.len() <= 2, "{syncs:?}");
        // What is held winds up the drives' timers once more, if they have not run down before.
        let pushed = run.pushed.since(run.onset);
        assert!(pushed <= Duration::from_millis(11), "{phase}: pushed for {pushed:?}");
    }
}

#[test]
fn a_bus_that_is_healed_is_found_again_by_a_reset_and_not_before() {
    for wrong in [Disturbance::Stuck, Disturbance::Down, Disturbance::Fault(BusFault::Off)] {
        let mut run =
            Run::with(&[(250, on_bus(wrong)), (50_250, HostFault::Bus(BUS, None))]).cycles(80);
        let (sent, now) = (run.last_sent(), micros(run.onset, run.bench.node().bus().now()));
        assert!(sent < 5_000 && now > 75_000, "{wrong:?}: nothing is sent although it is healed");
        let mode = run.bench.ask(Request::Reset).unwrap();
        assert_eq!(mode, Mode::Ready, "{wrong:?}");
    }
}

#[test]
fn hazard_24_a_reset_without_the_interface_fails_and_one_with_it_succeeds() {
    let mut run = Run::with(&[(250, on_bus(Disturbance::Down))]).cycles(20);
    assert!(run.bench.ask(Request::Reset).is_err());
    let mut run = run.cycles(5);
    assert_eq!(run.end().1, Mode::DrivesOff);
    run.bench.bus_mut().disturb(BUS, None);
    assert_eq!(run.bench.ask(Request::Reset).unwrap(), Mode::Ready);
}

/// How a boot of the network ends, on which something goes wrong so many ms after it begins.
fn booted(after_ms: u64, host_fault: HostFault) -> (Result<(), String>, Wire) {
    let wire = Wire::default();
    let script = Scenario::parse(SCRIPT).unwrap();
    let mut bench = Bench::new(&config(KRAFT), script, 1, false, wire.clone());
    bench.bus_mut().plan(Instant::ZERO + Duration::from_millis(after_ms), host_fault);
    (bench.bring_up().map_err(|error| error.to_string()), wire)
}

#[test]
fn hazard_24_a_boot_on_a_bus_that_is_down_says_so_and_blames_no_drive() {
    // While it listens, while it reads, and while it writes; told by the driver, and by a frame not taken.
    for after_ms in [0, 10, 30, 60] {
        for (wrong, words) in [
            (Disturbance::Down, "bus 0: interface down"),
            (Disturbance::Fault(BusFault::Down), "bus 0: interface down"),
            (Disturbance::Fault(BusFault::Off), "bus 0: bus off"),
            (Disturbance::Fault(BusFault::Passive), "bus 0: error passive"),
            (Disturbance::Full, "bus 0: transmit queue full"),
        ] {
            let (outcome, _) = booted(after_ms, on_bus(wrong));
            assert_eq!(outcome, Err(words.to_owned()), "{wrong:?} after {after_ms} ms");
        }
    }
}

#[test]
fn hazard_26_a_bus_of_another_master_is_not_booted() {
    for frame in [Frame::new(0x080, []), Frame::new(0x201, [0; 6])] {
        let (outcome, wire) = booted(5, on_bus(Disturbance::Flood(frame)));
        assert_eq!(outcome, Err("another master is on the bus".to_owned()));
        let sent = wire.all().iter().filter(|(_, it)| it.frame.cob_id != frame.cob_id).count();
        assert!(wire.since(Instant::ZERO, 0).is_empty(), "no reset, no stop: {sent}");
    }
    let write = Frame::new(0x603, [0x2B, 0x00, 0x14, 5, 0, 0, 0, 0]);
    let (outcome, _) = booted(30, on_bus(Disturbance::Flood(write)));
    assert_eq!(outcome, Err("another master is on the bus".to_owned()), "it writes in the boot");
}

#[test]
fn hazard_25_after_a_short_gap_what_waited_is_drained_and_answers_no_sync() {
    for phase in PHASES {
        let stopped = HostFault::Stopped(Duration::from_micros(2_800));
        let run = Run::with(&[(phase, stopped)]).cycles(20);
        assert_eq!(run.end(), (None, Mode::Engaged), "{phase}");
        let gap = run.records.windows(2).map(|pair| micros(pair[0].at, pair[1].at)).max().unwrap();
        assert!((2_000..=4_000).contains(&gap), "{phase}: {gap}");
        let complete = run.records.iter().filter(|record| record.sampled == [true; 6]).count();
        assert!(complete >= 18, "{phase}: {complete} of 20, so the backlog is gone at once");
    }
}

#[test]
fn hazard_25_samples_that_waited_too_long_are_missing() {
    // The process stands still while the drives answer.
    let stopped = HostFault::Stopped(Duration::from_micros(2_800));
    let run = Run::with(&[(100, stopped)]).cycles(3);
    assert_eq!(run.records[0].sampled, [false; 6]);
    assert_eq!(run.records[1].sampled, [true; 6]);
}

#[test]
fn hazard_28_after_a_stop_the_first_torque_is_zero_and_no_sync_is_made_up_for() {
    for phase in PHASES {
        let stop = Duration::from_millis(50);
        let run = Run::with(&[(phase, HostFault::Stopped(stop))]).cycles(30);
        let resumed = run.onset + stop;
        assert_eq!(run.end(), (Some(Kind::Overrun), Mode::ZeroTorque), "{phase}");
        let first = run.records.iter().position(|record| record.mode.is_stopped()).unwrap();
        assert!(run.records[first..].iter().all(|record| record.targets == [0; 6]), "{phase}");
        let before = run.records[..first].last().map_or(Instant::ZERO, |record| record.at);
        assert!(before < run.onset, "{phase}: no torque was told after it");
        let syncs = run.wire.since(resumed, 0x080);
        let buses = 2;
        assert!(syncs.len() <= buses * 30, "{phase}: {} SYNCs", syncs.len());
        let late: Vec<_> = run.syncs().into_iter().filter(|at| *at >= 50_000).collect();
        let apart = late.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap();
        assert!(apart >= 500, "{phase}: two SYNCs within {apart} µs");
        assert!(run.pushed.since(run.onset) <= BY_TIMER + Duration::from_millis(51), "{phase}");
    }
}

#[test]
fn hazard_29_a_loop_that_is_late_again_and_again_is_stopped() {
    let host_faults: Vec<_> = (0..10)
        .map(|n| (n * 2_000 + 700, HostFault::Stopped(Duration::from_micros(1_000))))
        .collect();
    let run = Run::with(&host_faults).cycles(40);
    assert_eq!(run.end(), (Some(Kind::Late), Mode::ZeroTorque));
    assert!(run.told() <= 7_000, "{} µs: three late wake-ups in a row", run.told());
    let once = Run::with(&host_faults[..2]).cycles(40);
    assert_eq!(once.end(), (None, Mode::Engaged));
}

#[test]
fn hazard_31_a_host_that_was_suspended_switches_the_drives_off() {
    for phase in PHASES {
        let slept = HostFault::Suspended(Duration::from_millis(40));
        let run = Run::with(&[(phase, slept)]).cycles(10);
        assert_eq!(run.end(), (Some(Kind::Suspended), Mode::DrivesOff), "{phase}");
    }
}

#[test]
fn hazard_31_the_clock_on_the_wall_may_be_set_at_any_moment() {
    let steps = [0, 3_000_000, 2_000_000_000].map(Duration::from_secs);
    let set: Vec<_> = (250..).step_by(7_000).zip(steps.map(HostFault::ClockSet)).collect();
    let (set, plain) = (Run::with(&set).cycles(40), Run::with(&[]).cycles(40));
    assert_eq!(set.end(), (None, Mode::Engaged));
    for (set, plain) in set.records.iter().zip(&plain.records) {
        assert_eq!((set.at, set.targets), (plain.at, plain.targets));
    }
}

#[test]
fn hazard_26_the_kernel_is_asked_for_what_a_master_must_hear_and_nothing_else() {
    let patterns = config(KRAFT).patterns();
    let is_heard = |cob_id: u16| patterns[0].iter().any(|pattern| pattern.has(cob_id));
    let of_its_nodes = [0x081, 0x083, 0x183, 0x283, 0x583, 0x703];
    let of_foreign_masters = [0x000, 0x080, 0x201, 0x603];
    let of_strangers = [0x08F, 0x70F];
    for cob_id in [&of_its_nodes[..], &of_foreign_masters, &of_strangers].concat() {
        assert!(is_heard(cob_id), "{cob_id:03X}");
    }
    for cob_id in [0x001, 0x07F, 0x100, 0x101, 0x1FF, 0x5FF, 0x6FF, 0x780, 0x7E5, 0x7FF] {
        assert!(!is_heard(cob_id), "{cob_id:03X}");
    }
}

#[test]
fn hazard_26_a_flood_that_loses_every_arbitration_harms_nobody() {
    let flood = on_bus(Disturbance::Flood(Frame::new(0x7FF, [0x55; 8])));
    let run = Run::with(&[(250, flood)]).cycles(1_000);
    assert_eq!(run.end(), (None, Mode::Engaged));
    let mut apart = run.records.windows(2).map(|pair| micros(pair[0].at, pair[1].at));
    assert!(apart.all(|apart| apart == 1_000), "every SYNC on its grid");
}

#[test]
fn hazard_26_a_flood_that_wins_every_arbitration_stops_all() {
    for cob_id in [0x000, 0x001, 0x080, 0x181] {
        let flood = on_bus(Disturbance::Flood(Frame::new(cob_id, [])));
        for phase in PHASES {
            let run = Run::with(&[(phase, flood)]).cycles(30);
            assert!(run.end().1.is_stopped(), "{cob_id:03X} at {phase} µs");
            assert!(run.told() <= 5_000, "{cob_id:03X} at {phase} µs: {} µs", run.told());
            let pushed = run.pushed.since(run.onset);
            assert!(pushed <= Duration::from_millis(11), "{cob_id:03X} at {phase}: {pushed:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever is heard, no drive is told more than it may be, and the node keeps its time.
    #[test]
    fn hazard_26_no_frames_whatever_panic_the_node_or_hold_it_up(
        frames in proptest::collection::vec(
            (0_u16..0x800, proptest::collection::vec(any::<u8>(), 0..9)), 1..40),
    ) {
        let mut run = Run::with(&[]);
        for (cob_id, data) in frames {
            let frame = Frame::from_slice(cob_id, &data).unwrap();
            run.bench.bus_mut().disturb(BUS, Some(Disturbance::Flood(frame)));
            run = run.cycles(3);
            run.bench.bus_mut().disturb(BUS, None);
        }
        for pair in run.records.windows(2) {
            // A frame ends between two microseconds.
            prop_assert!(micros(pair[0].at, pair[1].at).abs_diff(1_000) <= 1);
            let is_latched = pair[0].mode.is_stopped();
            prop_assert!(!is_latched || pair[1].mode.is_stopped());
            prop_assert!(!is_latched || pair[1].mode == Mode::ReflectionOff || pair[1].targets == [0; 6]);
        }
    }
}
