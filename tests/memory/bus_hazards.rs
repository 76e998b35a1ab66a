//! The hazards of the bus, the adapter and the host (21 to 26, 28 and 29), at several phases of a cycle: the
//! reaction of the node, and the time until the drives are torque-free.

use proptest::prelude::*;

use crate::common::prelude::*;
use faults::{Disturbance, Fault, HostFault};
use node::cause::CauseKind;

const BUS: Channel = Channel(0);

/// Phases of a cycle of 1 ms, in µs: during SYNC, and after the targets. A campaign tries all.
const PHASES: [u64; 2] = [20, 600];

/// The operator engages the arm and moves it continuously.
const SCRIPT: &str = "seconds = 60\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.2\ndeadman = true\n\
    [[move]]\nat_s = 0.25\nduration_s = 1.0\nto_m = [0.0, 0.05, 0.0]\n";

/// Cycles until gravity compensation has ramped up and the hand moves.
const SETTLED: u64 = 400;

/// The drives' own timers end their torque within 6 ms of the last target; it is measured once in a cycle of 1 ms.
const BY_TIMER: Duration = Duration::from_millis(7);

/// A run with faults.
struct Run {
    bench: Bench<Wire>,
    wire: Wire,
    onset: Instant,
    records: Vec<Record>,
    /// The last time between two cycles at which a drive exerted torque.
    last_torque: Instant,
}

impl Run {
    /// Runs until the operator is engaged, and injects `faults`, whose times count from the next SYNC.
    fn with(faults: &[Fault]) -> Self {
        Self::of(&config(KRAFT), faults)
    }

    fn of(config: &Config, faults: &[Fault]) -> Self {
        let wire = Wire::default();
        let mut bench = started(config, script(SCRIPT), wire.clone());
        bench.run(SETTLED);
        let last = bench.cycle();
        assert_eq!(last.mode, Mode::Engaged);
        let due = last.at + config.period;
        for fault in faults {
            bench.bus_mut().inject(due, fault);
        }
        let onset = due + faults.first().map_or(Duration::ZERO, |fault| fault.start);
        Self { bench, wire, onset, records: Vec::new(), last_torque: onset }
    }

    fn cycles(mut self, cycles: usize) -> Self {
        for _ in 0..cycles {
            self.records.push(self.bench.cycle());
            let torques = self.bench.world_mut().torques();
            if torques.iter().any(|torque| torque.abs() > 0.02) {
                self.last_torque = self.bench.node().bus().now();
            }
        }
        self
    }

    /// Returns the cause of the stop, and the mode at the end.
    fn end(&self) -> (Option<CauseKind>, Mode) {
        let last = self.records.last().unwrap();
        (last.cause.map(|cause| cause.kind()), last.mode)
    }

    /// Returns the end of the first cycle from which all targets are zero, in µs after the onset.
    fn zero_after(&self) -> u64 {
        let last = self.records.iter().rposition(|record| record.targets != [0; 6]);
        let first = &self.records[last.map_or(0, |place| place + 1)];
        micros(self.onset, first.at)
    }

    /// Returns the times of SYNC on the bus since the onset, in µs after it.
    fn syncs(&self) -> Vec<u64> {
        let syncs = self.wire.since(self.onset, 0x080).into_iter();
        let all = self.wire.all();
        let on_bus = |at: Instant| {
            let is_it = |(when, telegram): &(Instant, Telegram)| {
                *when == at && telegram.channel == BUS && telegram.frame.cob_id == 0x080
            };
            all.iter().any(is_it)
        };
        syncs.map(|(at, _)| at).filter(|at| on_bus(*at)).map(|at| micros(self.onset, at)).collect()
    }

    /// Returns the time of the node's last frame on the bus, in µs after the onset.
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

fn on_bus(micros: u64, disturbance: Disturbance) -> Fault {
    Fault::of_bus(Duration::from_micros(micros), BUS, disturbance)
}

fn of_host(micros: u64, fault: HostFault, span: Duration) -> Fault {
    Fault::of_host(Duration::from_micros(micros), fault, span)
}

/// Disturbs one bus at every phase: the drives are switched off for one of `kinds`, targets are zero within `cycles`,
/// nothing more is sent on that bus, and no drive exerts torque when its timer has run out. Where the drives' answers
/// stop within a cycle, they may be missed first.
fn ends_sending(disturbance: Disturbance, kinds: &[CauseKind], cycles: u64) {
    for phase in PHASES {
        let run = Run::with(&[on_bus(phase, disturbance)]).cycles(30);
        let (cause, mode) = run.end();
        assert!(kinds.contains(&cause.unwrap()), "{disturbance} at {phase} µs: {cause:?}");
        assert_eq!(mode, Mode::DrivesOff, "{disturbance} at {phase} µs");
        let (zero, sent) = (run.zero_after(), run.last_sent());
        assert!(zero <= cycles * 1_000, "{disturbance} at {phase} µs: {zero} µs");
        assert!(sent <= cycles * 1_000, "{disturbance} at {phase} µs: {sent}");
        let torque_for = run.last_torque.since(run.onset + Duration::from_micros(run.last_sent()));
        assert!(torque_for <= BY_TIMER, "{disturbance} at {phase} µs: torque for {torque_for:?}");
    }
}

#[test]
fn hazard_21_queue_full_for_two_cycles_ends_all_sending() {
    ends_sending(Disturbance::QueueFull, &[CauseKind::QueueFull], 3);
}

#[test]
fn hazard_22_stuck_adapter_ends_all_sending() {
    ends_sending(
        Disturbance::AdapterStuck,
        &[CauseKind::TransmitUnconfirmed, CauseKind::SamplesMissing],
        4,
    );
}

#[test]
fn hazard_23_bus_off_ends_all_sending_within_a_cycle() {
    ends_sending(Disturbance::BusOff, &[CauseKind::BusOff], 2);
}

#[test]
fn hazard_23_either_of_two_buses_at_650_us_ends_all_sending() {
    let guarding = "[switches.boot]\nguard_time_ms = 20\nlife_time_factor = 3\n\n[controller]\n";
    let text = fs::read_to_string("config/jpl_like_1538hz.toml").unwrap();
    let guarded = text.replacen("[controller]\n", guarding, 1);
    let config = Config::parse("config/jpl_like_1538hz.toml".as_ref(), &guarded).unwrap();
    assert!(text != guarded && config.period < Duration::from_micros(651));
    let rows: [(Disturbance, &[CauseKind], u32); 3] = [
        (Disturbance::BusOff, &[CauseKind::BusOff], 2),
        (Disturbance::InterfaceDown, &[CauseKind::BusDown], 2),
        (
            Disturbance::AdapterStuck,
            &[CauseKind::TransmitUnconfirmed, CauseKind::SamplesMissing],
            4,
        ),
    ];
    for (disturbance, kinds, cycles) in rows {
        for (channel, phase) in [(0, 20), (0, 300), (1, 20), (1, 300)] {
            let start = Duration::from_micros(phase);
            let fault = Fault::of_bus(start, Channel(channel), disturbance);
            let run = Run::of(&config, &[fault]).cycles(40);
            let context = format!("{disturbance} on bus {channel} at {phase} µs");
            let (cause, mode) = run.end();
            assert!(kinds.contains(&cause.unwrap()), "{context}: {cause:?}");
            assert_eq!(mode, Mode::DrivesOff, "{context}");
            let zero = Duration::from_micros(run.zero_after());
            assert!(zero <= config.period * cycles, "{context}: {zero:?}");
            let torque_for = run.last_torque.since(run.onset);
            assert!(torque_for <= BY_TIMER, "{context}: torque for {torque_for:?}");
        }
    }
}

#[test]
fn hazard_23_error_passive_is_zero_torque_and_warning_is_not() {
    for phase in PHASES {
        let run = Run::with(&[on_bus(phase, Disturbance::ErrorPassive)]).cycles(30);
        assert_eq!(run.end(), (Some(CauseKind::BusPassive), Mode::ZeroTorque));
        assert!(run.zero_after() <= 2_000 && run.last_sent() > 28_000, "{phase}");
        let run = Run::with(&[on_bus(phase, Disturbance::ErrorWarning)]).cycles(30);
        assert_eq!(run.end(), (None, Mode::Engaged));
    }
}

#[test]
fn hazard_24_interface_down_ends_all_sending() {
    ends_sending(Disturbance::AdapterUnplugged, &[CauseKind::BusDown], 2);
    ends_sending(Disturbance::InterfaceDown, &[CauseKind::BusDown], 2);
}

#[test]
fn hazard_22_late_frames_of_a_stalled_adapter_meet_no_sync() {
    for (phase, stalls) in [(20, 3_000), (250, 4_400), (600, 8_000)] {
        let stalled = on_bus(phase, Disturbance::AdapterStalled);
        let run = Run::with(&[stalled.lasting(Duration::from_micros(stalls))]).cycles(60);
        assert_eq!(run.end().1, Mode::DrivesOff, "{phase}");
        // One on the wire at the start, and one that was held back.
        let syncs = run.syncs();
        assert!(syncs.len() <= 2, "{syncs:?}");
        // A held target restarts the drives' timers if they have not run out.
        let torque_for = run.last_torque.since(run.onset);
        assert!(torque_for <= Duration::from_millis(11), "{phase}: torque for {torque_for:?}");
    }
}

#[test]
fn recovered_bus_is_used_after_a_reset_and_not_before() {
    for disturbance in [Disturbance::AdapterStuck, Disturbance::InterfaceDown, Disturbance::BusOff]
    {
        let fault = on_bus(250, disturbance).lasting(Duration::from_millis(50));
        let mut run = Run::with(&[fault]).cycles(80);
        let (sent, now) = (run.last_sent(), micros(run.onset, run.bench.node().bus().now()));
        assert!(sent < 5_000 && now > 75_000, "{disturbance}: nothing is sent after its end");
        let mode = run.bench.ask(Request::Reset).unwrap();
        assert_eq!(mode, Mode::Ready, "{disturbance}");
    }
}

#[test]
fn hazard_24_reset_needs_the_interface() {
    let mut run = Run::with(&[on_bus(250, Disturbance::InterfaceDown)]).cycles(20);
    assert!(run.bench.ask(Request::Reset).is_err());
    let mut run = run.cycles(5);
    assert_eq!(run.end().1, Mode::DrivesOff);
    run.bench.bus_mut().disturb(BUS, None);
    assert_eq!(run.bench.ask(Request::Reset).unwrap(), Mode::Ready);
}

/// Returns the end of a boot of the network with a disturbance this many ms after its start.
fn booted(after_ms: u64, disturbance: Disturbance) -> (Result<(), String>, Wire) {
    let wire = Wire::default();
    let mut bench = Bench::new(&config(KRAFT), script(SCRIPT), 1, wire.clone());
    bench.bus_mut().inject(Instant::ZERO, &on_bus(1_000 * after_ms, disturbance));
    (bench.bring_up().map_err(|error| error.to_string()), wire)
}

#[test]
fn hazard_24_boot_on_a_bus_that_is_down_names_no_drive() {
    // While the node listens, uploads and downloads; reported by the driver, and by a refused frame.
    for after_ms in [0, 10, 30, 60] {
        for (wrong, words) in [
            (Disturbance::InterfaceDown, "bus 0: interface down"),
            (Disturbance::AdapterUnplugged, "bus 0: interface down"),
            (Disturbance::BusOff, "bus 0: bus off"),
            (Disturbance::ErrorPassive, "bus 0: error passive"),
            (Disturbance::QueueFull, "bus 0: transmit queue full"),
        ] {
            let (outcome, _) = booted(after_ms, wrong);
            assert_eq!(outcome, Err(words.to_owned()), "{wrong:?} after {after_ms} ms");
        }
    }
}

#[test]
fn hazard_26_bus_of_another_master_is_not_booted() {
    for frame in [Frame::new(0x080, []), Frame::new(0x201, [0; 6])] {
        let (outcome, wire) = booted(5, Disturbance::Flood(frame));
        assert_eq!(outcome, Err("another master is on the bus".to_owned()));
        let sent = wire.all().iter().filter(|(_, it)| it.frame.cob_id != frame.cob_id).count();
        assert!(wire.since(Instant::ZERO, 0).is_empty(), "no reset, no stop: {sent}");
    }
    let write = Frame::new(0x603, [0x2B, 0x00, 0x14, 5, 0, 0, 0, 0]);
    let (outcome, _) = booted(30, Disturbance::Flood(write));
    assert_eq!(outcome, Err("another master is on the bus".to_owned()), "it writes in the boot");
}

#[test]
fn hazard_25_backlog_of_a_short_gap_is_drained_at_once() {
    for phase in PHASES {
        let span = Duration::from_micros(2_800);
        let run = Run::with(&[of_host(phase, HostFault::ProcessStopped, span)]).cycles(20);
        assert_eq!(run.end(), (None, Mode::Engaged), "{phase}");
        let gap = run.records.windows(2).map(|pair| micros(pair[0].at, pair[1].at)).max().unwrap();
        assert!((2_000..=4_000).contains(&gap), "{phase}: {gap}");
        let complete = run.records.iter().filter(|record| record.sampled == [true; 6]).count();
        assert!(complete >= 18, "{phase}: {complete} of 20, so the backlog is gone at once");
    }
}

#[test]
fn hazard_25_samples_buffered_too_long_are_missing() {
    // The process is stopped while the drives answer.
    let span = Duration::from_micros(2_800);
    let run = Run::with(&[of_host(100, HostFault::ProcessStopped, span)]).cycles(3);
    assert_eq!(run.records[0].sampled, [false; 6]);
    assert_eq!(run.records[1].sampled, [true; 6]);
}

#[test]
fn hazard_28_first_target_after_a_stop_is_zero_without_a_burst() {
    for phase in PHASES {
        let stop = Duration::from_millis(50);
        let run = Run::with(&[of_host(phase, HostFault::ProcessStopped, stop)]).cycles(30);
        let resumed = run.onset + stop;
        assert_eq!(run.end(), (Some(CauseKind::Overrun), Mode::ZeroTorque), "{phase}");
        let first = run.records.iter().position(|record| record.mode.is_stopped()).unwrap();
        assert!(run.records[first..].iter().all(|record| record.targets == [0; 6]), "{phase}");
        let before = run.records[..first].last().map_or(Instant::ZERO, |record| record.at);
        assert!(before < run.onset, "{phase}: no target was sent after it");
        let syncs = run.wire.since(resumed, 0x080);
        let buses = 2;
        assert!(syncs.len() <= buses * 30, "{phase}: {} SYNCs", syncs.len());
        let late: Vec<_> = run.syncs().into_iter().filter(|at| *at >= 50_000).collect();
        let apart = late.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap();
        assert!(apart >= 500, "{phase}: two SYNCs within {apart} µs");
        assert!(
            run.last_torque.since(run.onset) <= BY_TIMER + Duration::from_millis(51),
            "{phase}"
        );
    }
}

#[test]
fn hazard_29_repeated_late_cycles_stop_the_node() {
    let late =
        |n: u64| of_host(n * 2_000 + 700, HostFault::ProcessStopped, Duration::from_millis(1));
    let faults: Vec<Fault> = (0..10).map(late).collect();
    let run = Run::with(&faults).cycles(40);
    assert_eq!(run.end(), (Some(CauseKind::Late), Mode::ZeroTorque));
    assert!(run.zero_after() <= 7_000, "{} µs: three late wake-ups in a row", run.zero_after());
    let once = Run::with(&faults[..2]).cycles(40);
    assert_eq!(once.end(), (None, Mode::Engaged));
}

#[test]
fn hazard_26_receive_filter_passes_configured_cob_ids_alone() {
    let patterns = config(KRAFT).patterns();
    let passes = |cob_id: u16| patterns[0].iter().any(|pattern| pattern.has(cob_id));
    let of_its_nodes = [0x081, 0x083, 0x183, 0x283, 0x583, 0x703];
    let of_foreign_masters = [0x000, 0x080, 0x201, 0x603, 0x77F];
    let of_unknown_nodes = [0x08F, 0x70F];
    for cob_id in [&of_its_nodes[..], &of_foreign_masters, &of_unknown_nodes].concat() {
        assert!(passes(cob_id), "{cob_id:03X}");
    }
    for cob_id in [0x001, 0x07F, 0x100, 0x101, 0x1FF, 0x5FF, 0x6FF, 0x780, 0x7E5, 0x7FF] {
        assert!(!passes(cob_id), "{cob_id:03X}");
    }
}

#[test]
fn hazard_26_flood_that_loses_every_arbitration_stops_nothing() {
    let flood = on_bus(250, Disturbance::Flood(Frame::new(0x7FF, [0x55; 8])));
    let run = Run::with(&[flood]).cycles(1_000);
    assert_eq!(run.end(), (None, Mode::Engaged));
    let mut apart = run.records.windows(2).map(|pair| micros(pair[0].at, pair[1].at));
    assert!(apart.all(|apart| apart == 1_000), "every SYNC on its grid");
}

#[test]
fn hazard_26_flood_that_wins_every_arbitration_stops_all() {
    for cob_id in [0x000, 0x001, 0x080, 0x181] {
        let flood = Disturbance::Flood(Frame::new(cob_id, []));
        for phase in PHASES {
            let run = Run::with(&[on_bus(phase, flood)]).cycles(30);
            assert!(run.end().1.is_stopped(), "{cob_id:03X} at {phase} µs");
            assert!(
                run.zero_after() <= 5_000,
                "{cob_id:03X} at {phase} µs: {} µs",
                run.zero_after()
            );
            let torque_for = run.last_torque.since(run.onset);
            assert!(
                torque_for <= Duration::from_millis(11),
                "{cob_id:03X} at {phase}: {torque_for:?}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// With any frames, targets keep their limits, and the node keeps its period.
    #[test]
    fn hazard_26_arbitrary_frames_never_delay_the_node(
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
