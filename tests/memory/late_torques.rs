//! A process that is stopped within a cycle, after any of its frames (hazard 29, promise 10): late torques are not
//! sent, zeros are.

use std::cell::RefCell;
use std::rc::Rc;

use crate::common::prelude::*;
use bus::Tap;
use faults::{Fault, HostFault};
use node::cause::CauseKind;
use telemetry::losses::Losses;
use telemetry::status::Status;
use telemetry::summary::Summary;

/// The operator engages and moves the arm.
const SCRIPT: &str = "seconds = 60\n[[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.2\ndeadman = true\n\
    [[move]]\nat_s = 0.25\nduration_s = 2.0\nto_m = [0.0, 0.1, 0.0]\n";

/// Every frame that the buses accepted from the node, with its time.
#[derive(Clone, Default)]
struct AcceptedFrames(Rc<RefCell<Vec<(Instant, Telegram)>>>);

impl Tap for AcceptedFrames {
    fn on_wire(&mut self, _: Instant, _: &Telegram) {}

    fn on_taken(&mut self, at: Instant, telegram: &Telegram) {
        self.0.borrow_mut().push((at, *telegram));
    }
}

impl AcceptedFrames {
    fn since(&self, from: Instant) -> Vec<(Instant, Frame)> {
        let since = self.0.borrow();
        let since = since.iter().filter(|(at, _)| *at >= from);
        since.map(|(at, telegram)| (*at, telegram.frame)).collect()
    }

    /// Returns, for each SYNC of a bus, the frames with torque from it to the next one.
    fn torques_by_sync(&self, channel: Channel) -> Vec<Vec<Frame>> {
        let all = self.0.borrow();
        let mut torques = vec![Vec::new()];
        for (_, telegram) in all.iter().filter(|(_, it)| it.channel == channel) {
            match telegram.frame {
                sync if sync.cob_id == 0x080 => torques.push(Vec::new()),
                frame if asks(&frame) => torques.last_mut().unwrap().push(frame),
                _ => {}
            }
        }
        torques
    }

    /// Returns the times of SYNC on a bus.
    fn syncs(&self, channel: Channel) -> Vec<Instant> {
        let all = self.0.borrow();
        let of = all.iter().filter(|(_, it)| it.channel == channel && it.frame.cob_id == 0x080);
        of.map(|(at, _)| *at).collect()
    }
}

struct Run {
    bench: Bench<AcceptedFrames>,
    accepted: AcceptedFrames,
    period: Duration,
    from: Instant,
    records: Vec<Record>,
}

impl Run {
    /// Engaged, with these stops planned: after which frame, for how many tenths of a period, in which cycle
    /// from now on.
    fn with(name: &str, stops: &[(u32, u16, u32)]) -> Self {
        Self::planned(name, stops, HostFault::ProcessStoppedAfter)
    }

    /// The same with stops of another kind.
    fn planned(name: &str, stops: &[(u32, u16, u32)], kind: fn(u16) -> HostFault) -> Self {
        Self::played(SCRIPT, name, stops, kind)
    }

    /// The same with another script.
    fn played(
        text: &str,
        name: &str,
        stops: &[(u32, u16, u32)],
        kind: fn(u16) -> HostFault,
    ) -> Self {
        let (config, accepted) = (config(name), AcceptedFrames::default());
        let mut bench = started(&config, script(text), accepted.clone());
        while bench.elapsed() < Duration::from_millis(800) {
            bench.cycle();
        }
        let last = bench.cycle();
        assert_eq!(last.mode, Mode::Engaged);
        // Just before the next SYNC.
        let from = last.at + config.period - Duration::from_micros(10);
        for (cycle, after, tenths) in stops {
            let span = config.period / 10 * *tenths;
            let fault = kind(*after);
            bench.bus_mut().inject(from, &Fault::of_host(config.period * *cycle, fault, span));
        }
        Self { bench, accepted, period: config.period, from, records: vec![last] }
    }

    fn cycles(mut self, count: usize) -> Self {
        self.records.extend((0..count).map(|_| self.bench.cycle()));
        self
    }

    /// Torques that are not zero, and how long after the SYNC before them they were accepted away.
    fn torques(&self) -> Vec<(Duration, Frame)> {
        let mut sync = None;
        let mut torques = Vec::new();
        for (at, frame) in self.accepted.since(self.from) {
            if frame.cob_id == 0x080 {
                sync = Some(at);
            } else if let (Some(sync), true) = (sync, asks(&frame)) {
                torques.push((at.since(sync), frame));
            }
        }
        torques
    }
}

/// Returns whether a frame has a non-zero target, with a controlword before it or without.
fn asks(frame: &Frame) -> bool {
    match (frame.cob_id, frame.data()) {
        (0x201..=0x206, &[_, _, low, high]) => (low, high) != (0, 0),
        (0x201..=0x206, targets) => targets.iter().any(|byte| *byte != 0),
        _ => false,
    }
}

#[test]
fn hazard_29_stall_between_two_buses_sends_no_burst_of_syncs() {
    for tenths in 1..40 {
        let run = Run::with(JPL, &[(1, 0x080, tenths)]).cycles(10);
        for channel in [Channel(0), Channel(1)] {
            let syncs = run.accepted.syncs(channel);
            let apart = syncs.windows(2).map(|pair| pair[1].since(pair[0])).min().unwrap();
            assert!(apart >= run.period / 2, "{tenths} tenths, {channel:?}: {apart:?}");
        }
    }
}

#[test]
fn hazard_29_bus_without_a_sync_gets_no_second_torque() {
    // The arm is balanced: reflection gives torques, and a turn of the grip those of the second bus.
    let script = SCRIPT
        .replace("[[move]]", "[[switch]]\nat_s = 0.25\nreflection = true\n[[move]]")
        .replace("duration_s = 2.0", "duration_s = 0.5\nto_rad = [0.3, 0.3, 0.3]");
    for name in [JPL, "config/jpl_like_1538hz.toml"] {
        let mut skipped = 0;
        for tenths in 1..40 {
            let (stop, kind) = ((1, 0x080, tenths), HostFault::ProcessStoppedAfter);
            let run = Run::played(&script, name, &[stop], kind).cycles(10);
            let [first, second] = [Channel(0), Channel(1)].map(|it| run.accepted.syncs(it).len());
            skipped += first - second;
            for channel in [Channel(0), Channel(1)] {
                let torques = run.accepted.torques_by_sync(channel);
                assert!(torques.concat().len() > 100, "{name}: {channel:?} has torques");
                for frames in torques {
                    let mut senders: Vec<u16> = frames.iter().map(|frame| frame.cob_id).collect();
                    senders.sort_unstable();
                    senders.dedup();
                    assert_eq!(
                        senders.len(),
                        frames.len(),
                        "{name}, {tenths} tenths, {channel:?}: {frames:?}"
                    );
                }
            }
        }
        assert!(skipped > 10, "{name}: {skipped} SYNCs of the second bus were left out");
    }
}

#[test]
fn hazard_31_suspension_at_any_frame_ends_torque() {
    let frames = |joints: std::ops::RangeInclusive<u16>| joints.map(|joint| 0x180 + joint);
    for (name, targets) in [(KRAFT, vec![0x201, 0x204]), (KRAFT_500HZ, vec![0x201, 0x203, 0x206])] {
        for after in [0x080].into_iter().chain(frames(1..=6)).chain(targets) {
            for tenths in [16, 40, 400] {
                let run = Run::planned(name, &[(0, after, tenths)], |after| {
                    HostFault::Suspended(Some(after))
                });
                let run = run.cycles(10);
                let last = run.records.last().unwrap();
                let kind = last.cause.map(|cause| cause.kind());
                let of = format!("{name}, after {after:03X}h, {tenths}");
                assert_eq!(
                    (kind, last.mode),
                    (Some(CauseKind::Suspended), Mode::DrivesOff),
                    "{of}"
                );
                let most = run.period + run.period / 2;
                let late = run.torques().into_iter().find(|(late, _)| *late > most);
                assert_eq!(late, None, "{of}");
            }
        }
    }
}

#[test]
fn promise_10_torques_delayed_at_any_frame_are_dropped() {
    for (name, frames) in [
        (KRAFT, &[0x080, 0x181, 0x186, 0x201][..]),
        (KRAFT_500HZ, &[0x080, 0x186, 0x201, 0x202, 0x205]),
    ] {
        for after in frames {
            for tenths in [11, 16, 24, 39] {
                let run = Run::with(name, &[(0, *after, tenths)]).cycles(10);
                let torques = run.torques();
                assert!(!torques.is_empty() || tenths > 16, "{name}, after {after:03X}h, {tenths}");
                for (late, frame) in torques {
                    let most = run.period + run.period / 2;
                    assert!(late <= most, "{name}, after {after:03X}h, {tenths}: {frame} {late:?}");
                }
                // After a longer stop the drives' own timers may have ended their torque.
                let last = run.records.last().unwrap();
                let is_engaged = (last.mode, last.cause) == (Mode::Engaged, None);
                assert!(
                    is_engaged || tenths > 16,
                    "{name}, after {after:03X}h, {tenths}: {last:?}"
                );
            }
        }
    }
}

#[test]
fn hazard_29_ten_late_torques_in_a_second_stop_the_node() {
    let stops: Vec<_> = (0..10).map(|turn| (20 * turn, 0x186, 11)).collect();
    let run = Run::with(KRAFT, &stops).cycles(200);
    let before = run.records[0].overruns;
    let stopped = run.records.iter().find(|record| record.mode.is_stopped()).unwrap();
    assert_eq!(stopped.cause.map(|cause| cause.kind()), Some(CauseKind::Late));
    assert_eq!(stopped.targets, [0; 6]);
    assert_eq!(stopped.overruns - before, 10);
    assert_eq!(Status::from_record(stopped, 0, Losses::default()).overruns, stopped.overruns);
    let mut summary = Summary::default();
    run.records.iter().for_each(|record| summary.add(record));
    assert_eq!(summary.overruns, stopped.overruns);
    assert!(summary.to_string().contains("overruns          10 cycles"), "{summary}");
}

#[test]
fn hazard_28_zero_torques_are_sent_however_late() {
    // The process is stopped in the third cycle without the sixth drive, after the fifth one's sample.
    let mut run = Run::with(KRAFT, &[(2, 0x185, 30)]);
    run.bench.world_mut().drive_mut(Joint::of::<6>()).unwrap().unplug();
    let run = run.cycles(5);
    let first = run.records.iter().position(|record| record.mode.is_stopped()).unwrap();
    let [stopped, next] = [0, 1].map(|place| &run.records[first + place]);
    assert_eq!(stopped.cause.map(|cause| cause.kind()), Some(CauseKind::SamplesMissing));
    let accepted = run.accepted.since(stopped.at + run.period * 3);
    let zeros = accepted.iter().filter(|(at, frame)| {
        *at < next.at && matches!(frame.cob_id, 0x201 | 0x204) && frame.data() == [0; 6]
    });
    assert_eq!(zeros.count(), 2, "late, in the same cycle");
}

#[test]
fn promise_10_stall_after_the_last_torque_withdraws_all_targets() {
    for (name, last, frames) in [(KRAFT, 0x204, 2), (KRAFT_500HZ, 0x206, 6)] {
        let run = Run::with(name, &[(0, last, 16)]).cycles(10);
        let (before, stalled) = (&run.records[0], &run.records[1]);
        assert_eq!(stalled.targets, [0; 6], "{name}");
        assert_eq!(stalled.overruns - before.overruns, 1, "{name}: counted once");
        let accepted = run.accepted.since(stalled.at);
        // The next SYNC may follow in the same microsecond.
        let in_cycle = accepted.iter().skip(1).take_while(|(_, frame)| frame.cob_id != 0x080);
        let targets: Vec<_> = in_cycle
            .map(|(_, frame)| frame)
            .filter(|frame| (0x201..=0x206).contains(&frame.cob_id))
            .collect();
        let torques = targets.iter().filter(|frame| asks(frame)).count();
        assert!(torques > 0 && targets.len() == frames + torques, "{name}: {targets:?}");
        assert!(targets[frames..].iter().all(|frame| !asks(frame)), "{name}: {targets:?}");
        let rise = config(name).controller.extensions.slew.unwrap().rise().amax();
        let after = run.records[2].output.tau.amax();
        assert!(after <= 1.01 * rise, "{name}: {after} N·m in the first cycle after zero");
        // One late cycle is no stop, and the torques rise again.
        let end = run.records.last().unwrap();
        assert_eq!((end.mode, end.cause), (Mode::Engaged, None), "{name}");
        assert_ne!(end.targets, [0; 6], "{name}");
    }
}
