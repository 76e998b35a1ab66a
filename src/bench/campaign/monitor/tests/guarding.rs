//! Drives that node guarding alone stops: those of config/drives/technosoft_ipos.toml.

use super::*;
use crate::monitor::invariant::Moment;

const IPOS: &str = "config/drives/technosoft_ipos.toml";

fn bench() -> Bench {
    let config = Config::load(Path::new(IPOS)).unwrap();
    Bench { monitor: Monitor::new(&config), now: 100_000 }
}

impl Bench {
    fn poll(&mut self, node: u16) {
        self.now += 10;
        let telegram = Telegram { channel: Channel(0), frame: Frame::remote(0x700 + node, 1) };
        self.monitor.on_sent(Instant::from_micros(self.now), &telegram);
    }

    /// Each drive reports a lost master.
    fn report_lost_guarding(&mut self) {
        for joint in Joint::ALL {
            let emergency = self.monitor.sheet.nodes[joint.index()].emergency;
            self.received(emergency, &[0x30, 0x81, 0x11, 0, 0, 0, 0, 0]);
        }
    }

    /// Returns whether a drive was proven, so that it may receive a target.
    fn are_proven(&self) -> bool {
        let mut nodes = self.monitor.sheet.nodes.iter().take(6);
        let mut known = self.monitor.order.clone();
        let mut violations = Violations::default();
        for joint in Joint::ALL {
            let at = Instant::from_micros(self.now);
            let (sheet, violations) = (&*self.monitor.sheet, &mut violations);
            known.on_target(&mut Moment { sheet, at, violations }, joint, 1);
        }
        nodes.all(|member| member.timers.is_guarded()) && violations.count() == 0
    }
}

#[test]
fn i6_guarded_drive_is_proven_by_its_silence_alone() {
    let mut bench = bench();
    assert!(!bench.are_proven(), "no emergency yet");
    bench.report_lost_guarding();
    assert!(!bench.are_proven(), "none was guarded");
    (1..=6).for_each(|node| bench.poll(node));
    bench.now += 20_000;
    bench.report_lost_guarding();
    assert!(!bench.are_proven(), "sooner than the life time of 30 ms");
    bench.now += 10_000;
    bench.report_lost_guarding();
    assert!(bench.are_proven());
    (1..=6).for_each(|node| bench.received(0x700 + node, &[0]));
    assert!(!bench.are_proven(), "a boot ends the proof");
}

#[test]
fn i9_remote_frames_go_to_guarded_nodes_alone() {
    let mut bench = bench();
    bench.poll(3);
    assert_eq!(bench.violated(), []);
    bench.poll(9);
    assert_eq!(bench.violated(), [Invariant::OwnIdentifiers], "no node has this node-id");
    let mut bench = Bench::cold();
    bench.poll(3);
    assert_eq!(bench.violated(), [Invariant::OwnIdentifiers], "it sends a heartbeat");
}
