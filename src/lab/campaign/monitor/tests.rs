//! That the judge sees every law broken, and none where none is.

use std::path::Path;
use std::time::Duration;

use super::*;
use bus::Tap;
use canopen::frame::Frame;
use units::numbering::Joint;

/// At 500 Hz, with one RPDO for each drive: controlword and target.
const PERIOD: u64 = 2_000;

const ENABLE: u16 = 0x000F;

struct Bench {
    monitor: Monitor,
    now: u64,
}

impl Bench {
    /// All nodes are known, started and at zero; 20 cycles have passed.
    fn running() -> Self {
        let mut bench = Self::cold();
        (1..=6).chain([16]).for_each(|node| bench.know(node));
        (1..=6).chain([16]).for_each(|node| bench.sent(0, &[1, node]));
        Joint::ALL.into_iter().for_each(|joint| bench.prove(joint));
        (0..20).for_each(|_| bench.cycle([0; 6]));
        bench
    }

    /// The same, armed, and the deadman pressed after that.
    fn engaged() -> Self {
        let mut bench = Self::running();
        bench.heard(0x190, &[0b10]);
        bench.ask(Request::Arm, Mode::Armed);
        bench.cycle([0; 6]);
        bench.heard(0x190, &[0b01]);
        bench
    }

    /// The same, at some torque on every joint.
    fn pushing() -> Self {
        let mut bench = Self::engaged();
        (1..=16).for_each(|step| bench.cycle([20 * step; 6]));
        assert_eq!(bench.laws(), []);
        bench
    }

    fn cold() -> Self {
        let config = Config::load(Path::new("config/kraft_like_500hz.toml")).unwrap();
        Self { monitor: Monitor::new(&config), now: 100_000 }
    }

    fn sent(&mut self, cob_id: u16, data: &[u8]) {
        let telegram = self.taken(cob_id, data);
        self.monitor.on_sent(Instant::from_micros(self.now), &telegram);
    }

    /// Given away, and not on the wire yet.
    fn taken(&mut self, cob_id: u16, data: &[u8]) -> Telegram {
        let telegram = self.telegram(cob_id, data);
        self.monitor.on_taken(Instant::from_micros(self.now), &telegram);
        telegram
    }

    /// What was given away comes out.
    fn comes(&mut self, telegram: Telegram) {
        self.now += 10;
        self.monitor.on_sent(Instant::from_micros(self.now), &telegram);
    }

    /// A drive cries without RPDOs, and without heartbeats.
    fn prove(&mut self, joint: Joint) {
        let emergency = self.monitor.sheet.nodes[joint.index()].emergency;
        [0x50, 0x30].into_iter().zip([0x82, 0x81]).for_each(|(low, high)| {
            self.heard(emergency, &[low, high, 0x11, 0, 0, 0, 0, 0]);
        });
    }

    fn heard(&mut self, cob_id: u16, data: &[u8]) {
        let telegram = self.telegram(cob_id, data);
        self.monitor.on_wire(Instant::from_micros(self.now), &telegram);
    }

    fn telegram(&mut self, cob_id: u16, data: &[u8]) -> Telegram {
        self.now += 10;
        Telegram { channel: Channel(0), frame: Frame::from_slice(cob_id, data).unwrap() }
    }

    fn ask(&mut self, request: Request, mode: Mode) {
        self.monitor.asked(Instant::from_micros(self.now), request, Some(mode));
    }

    fn target(&mut self, node: u16, word: u16, target: i16) {
        let ([a, b], [c, d]) = (word.to_le_bytes(), target.to_le_bytes());
        self.sent(0x200 + node, &[a, b, c, d]);
    }

    /// SYNC and six targets, with all drives enabled.
    fn cycle(&mut self, targets: [i16; 6]) {
        self.cycle_of(targets, ENABLE);
    }

    fn cycle_of(&mut self, targets: [i16; 6], word: u16) {
        self.now = self.now.next_multiple_of(PERIOD);
        self.sent(0x80, &[]);
        self.now += 500;
        for (node, target) in (1..).zip(targets) {
            self.target(node, word, target);
        }
        self.now += 500;
    }

    /// Asks a node who it is.
    fn know(&mut self, node: u8) {
        let product: u32 = if node == 16 { 0x0401_0008 } else { 0x0402_0010 };
        for (sub, value) in [(1, 0x0F8C), (2, product), (3, 0x0001_0000)] {
            let [a, b, c, d] = u32::to_le_bytes(value);
            self.sent(0x600 + u16::from(node), &[0x40, 0x18, 0x10, sub, 0, 0, 0, 0]);
            self.heard(0x580 + u16::from(node), &[0x43, 0x18, 0x10, sub, a, b, c, d]);
        }
    }

    /// The laws that were broken, each once.
    fn laws(&self) -> Vec<Law> {
        let mut laws: Vec<Law> = self.monitor.breaches().iter().map(|breach| breach.law).collect();
        laws.sort_unstable();
        laws.dedup();
        laws
    }
}

#[test]
fn a_run_as_it_should_be_breaks_no_law() {
    let mut bench = Bench::pushing();
    bench.sent(0x77F, &[5]);
    bench.heard(0x190, &[0b10]);
    (0..15).rev().for_each(|step| bench.cycle([20 * step; 6]));
    bench.ask(Request::Disarm, Mode::Ready);
    (0..5).for_each(|_| bench.cycle([0; 6]));
    bench.cycle_of([0; 6], 0);
    bench.sent(0, &[0x80, 3]);
    assert_eq!(bench.laws(), []);
    assert_eq!((bench.monitor.unarmed_frames(), bench.monitor.stale_targets()), (0, 0));
}

#[test]
fn i1_a_target_beyond_capacity_is_seen() {
    let mut bench = Bench::pushing();
    bench.cycle([0, 0, 0, 0, 0, 900]);
    assert!(bench.laws().contains(&Law::Cap), "{:?}", bench.monitor.breaches());
}

#[test]
fn i2_a_target_that_grows_too_fast_is_seen_and_one_that_shrinks_is_not() {
    let mut bench = Bench::pushing();
    bench.cycle([320, 320, 320, 320, 320, 200]);
    assert_eq!(bench.laws(), []);
    bench.cycle([320, 460, 320, 320, 320, 200]);
    assert_eq!(bench.laws(), [Law::Slew]);
    let mut bench = Bench::pushing();
    bench.cycle([320, -150, 320, 320, 320, 320]);
    assert_eq!(bench.laws(), [Law::Slew], "nor may it change its sign faster");
}

#[test]
fn i3_torque_without_arming_is_seen() {
    let mut bench = Bench::running();
    bench.cycle([0, 0, 1, 0, 0, 0]);
    assert_eq!((bench.laws(), bench.monitor.unarmed_frames()), (vec![Law::Permitted], 1));
}

#[test]
fn i3_torque_is_seen_50_ms_after_disarming() {
    let mut bench = Bench::pushing();
    bench.ask(Request::Disarm, Mode::Ready);
    (0..25).for_each(|_| bench.cycle([10; 6]));
    assert_eq!(bench.laws(), [], "the weight of the arm may be laid down");
    (0..2).for_each(|_| bench.cycle([10; 6]));
    assert_eq!(bench.laws(), [Law::Permitted]);
}

#[test]
fn i3_more_than_the_weight_of_the_arm_is_seen_when_the_deadman_is_open_for_long() {
    let mut bench = Bench::pushing();
    bench.heard(0x190, &[0b10]);
    (0..10).for_each(|_| bench.cycle([320; 6]));
    assert_eq!(bench.laws(), [], "what was felt may end by a ramp");
    (0..8).for_each(|_| bench.cycle([320; 6]));
    assert_eq!(bench.laws(), [Law::Permitted]);
}

/// A deadman that says each of these for so many ms; the mode is engaged at the end of the last.
fn engaged_after(says: &[(u8, u64)]) -> Vec<Law> {
    let mut bench = Bench::running();
    bench.heard(0x190, &[0b10]);
    bench.ask(Request::Arm, Mode::Armed);
    for (contacts, millis) in says {
        bench.heard(0x190, &[*contacts]);
        bench.monitor.told(Instant::from_micros(bench.now), Mode::Armed);
        bench.now += 1_000 * millis;
    }
    bench.monitor.told(Instant::from_micros(bench.now), Mode::Engaged);
    bench.laws()
}

#[test]
fn i3_deadman_that_has_not_settled_engages_nothing() {
    assert_eq!(engaged_after(&[(0b10, 25), (0b01, 25)]), []);
    assert_eq!(engaged_after(&[(0b10, 25), (0b01, 20)]), [Law::Permitted], "closed too briefly");
    assert_eq!(engaged_after(&[(0b10, 20), (0b01, 25)]), [Law::Permitted], "open too briefly");
    let bounces = [(0b10, 25), (0b01, 24), (0b11, 1), (0b01, 20)];
    assert_eq!(engaged_after(&bounces), [Law::Permitted], "from the last bounce");
}

#[test]
fn i3_a_deadman_whose_channels_disagree_permits_nothing() {
    let mut bench = Bench::running();
    bench.heard(0x190, &[0b10]);
    bench.ask(Request::Arm, Mode::Armed);
    bench.heard(0x190, &[0b11]);
    (1..=30).for_each(|step: i16| bench.cycle([0, 0, 0, 0, 0, 20 * step.min(16)]));
    assert_eq!(bench.laws(), [Law::Permitted]);
}

#[test]
fn i4_torque_after_a_trip_is_seen_until_it_is_armed_again() {
    let mut bench = Bench::pushing();
    bench.monitor.told(Instant::from_micros(bench.now), Mode::ZeroTorque);
    bench.cycle([0; 6]);
    assert_eq!(bench.laws(), []);
    bench.cycle([0, 1, 0, 0, 0, 0]);
    assert!(bench.laws().contains(&Law::Latched));
}

#[test]
fn i4_what_was_held_back_is_no_breach_where_the_drive_is_off() {
    let mut bench = Bench::pushing();
    bench.monitor.told(Instant::from_micros(bench.now), Mode::DrivesOff);
    bench.cycle([0; 6]);
    (1..=6).for_each(|node| bench.heard(0x180 + node, &[0x18, 0x02, 0, 0, 0, 0, 0, 0]));
    bench.cycle([20; 6]);
    assert_eq!(bench.laws(), []);
}

#[test]
fn i4_arming_without_a_reset_or_with_a_closed_deadman_is_seen() {
    let mut bench = Bench::pushing();
    bench.heard(0x190, &[0b10]);
    bench.monitor.told(Instant::from_micros(bench.now), Mode::ZeroTorque);
    bench.ask(Request::Arm, Mode::Armed);
    assert_eq!(bench.laws(), [Law::Latched]);
    let mut bench = Bench::running();
    bench.heard(0x190, &[0b01]);
    bench.ask(Request::Arm, Mode::Armed);
    assert_eq!(bench.laws(), [Law::Latched]);
}

#[test]
fn i5_a_target_that_is_left_out_comes_twice_or_late_is_seen() {
    let mut bench = Bench::running();
    bench.sent(0x80, &[]);
    (1..=5).for_each(|node| bench.target(node, ENABLE, 0));
    bench.cycle([0; 6]);
    assert!(bench.laws().contains(&Law::OncePerSync));
    let mut bench = Bench::running();
    bench.target(6, ENABLE, 0);
    bench.cycle([0; 6]);
    assert_eq!(bench.laws(), [Law::OncePerSync]);
    let mut bench = Bench::running();
    bench.now = bench.now.next_multiple_of(PERIOD);
    bench.sent(0x80, &[]);
    bench.now += 3_100;
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    assert_eq!(bench.laws(), [Law::OncePerSync]);
}

#[test]
fn i5_is_nobodys_fault_where_the_bus_is_broken() {
    let mut bench = Bench::running();
    let now = Instant::from_micros(bench.now);
    bench.monitor.excuse(Excuse::Bus(Channel(0), now));
    bench.now = bench.now.next_multiple_of(PERIOD);
    bench.sent(0x80, &[]);
    bench.cycle([0; 6]);
    assert_eq!(bench.laws(), []);
}

#[test]
fn i5_a_process_that_stood_still_may_say_zero_late_and_nothing_else() {
    for (target, laws) in [(0, vec![]), (1, vec![Law::OncePerSync])] {
        let mut bench = Bench::pushing();
        let now = Instant::from_micros(bench.now);
        bench.monitor.excuse(Excuse::Process(now, now + Duration::from_millis(20)));
        bench.now += 10_000;
        (1..=6).for_each(|node| bench.target(node, ENABLE, target));
        assert_eq!(bench.laws(), laws);
    }
    let mut bench = Bench::running();
    let now = Instant::from_micros(bench.now);
    bench.monitor.excuse(Excuse::Process(now, now + Duration::from_millis(1)));
    bench.now += 10_000;
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    assert_eq!(bench.laws(), [Law::OncePerSync], "not for ever");
}

/// Which joints' targets in force were stale when they began to act.
fn stale_joints(monitor: &Monitor) -> [bool; 6] {
    monitor.acting_ages().map(|age| monitor.is_stale(age))
}

#[test]
fn what_an_adapter_held_back_is_judged_by_when_it_was_given_away_and_counted_as_stale() {
    let mut bench = Bench::pushing();
    let now = Instant::from_micros(bench.now);
    bench.monitor.excuse(Excuse::Bus(Channel(0), now));
    let held = bench.taken(0x201, &[0x0F, 0, 100, 0]);
    bench.monitor.told(Instant::from_micros(bench.now), Mode::ZeroTorque);
    bench.now += 10_000;
    bench.comes(held);
    assert_eq!((bench.laws(), bench.monitor.stale_targets()), (vec![], 1));
    assert_eq!(stale_joints(&bench.monitor), [false; 6], "it acts at a SYNC");
    bench.sent(0x80, &[]);
    assert_eq!(
        stale_joints(&bench.monitor),
        [true; 6],
        "the others' as well: they waited for a SYNC"
    );
    let after = bench.taken(0x202, &[0x0F, 0, 100, 0]);
    bench.comes(after);
    assert!(bench.laws().contains(&Law::Latched), "given away after the trip");
    bench.target(1, ENABLE, 0);
    bench.sent(0x80, &[]);
    assert_eq!(stale_joints(&bench.monitor), [false, false, true, true, true, true]);
}

#[test]
fn i6_a_node_that_is_not_known_or_not_read_back_must_not_be_started() {
    let mut bench = Bench::cold();
    bench.sent(0, &[1, 3]);
    assert_eq!(bench.laws(), [Law::KnownFirst]);
    let mut bench = Bench::cold();
    bench.know(3);
    bench.sent(0x603, &[0x2B, 0x17, 0x10, 0, 100, 0, 0, 0]);
    bench.heard(0x583, &[0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    let mut other = Bench { monitor: bench.monitor.clone(), now: bench.now };
    bench.sent(0, &[1, 3]);
    assert_eq!(bench.laws(), [Law::KnownFirst], "written and not read back");
    other.sent(0x603, &[0x40, 0x17, 0x10, 0, 0, 0, 0, 0]);
    other.heard(0x583, &[0x4B, 0x17, 0x10, 0, 100, 0, 0, 0]);
    other.sent(0, &[1, 3]);
    assert_eq!(other.laws(), []);
}

#[test]
fn i6_a_drive_that_was_not_started_must_not_be_enabled() {
    let mut bench = Bench::running();
    bench.heard(0x703, &[0]);
    bench.cycle([0; 6]);
    assert_eq!(bench.laws(), [], "it was on its way");
    (0..2).for_each(|_| bench.cycle([0; 6]));
    assert_eq!(bench.laws(), [Law::KnownFirst], "it has booted since");
    bench.sent(0, &[1, 3]);
    let last = bench.monitor.breaches().last().map(|breach| breach.what.clone());
    let why = "node 3 is started before it has said who it is";
    assert_eq!(last.as_deref(), Some(why), "and is not known any more");
}

#[test]
fn i6_torque_before_a_drive_has_shown_that_it_stops_by_itself_is_seen() {
    let mut bench = Bench::engaged();
    bench.sent(0, &[0x81, 3]);
    bench.heard(0x703, &[0]);
    bench.know(3);
    bench.sent(0, &[1, 3]);
    bench.now += 10 * PERIOD;
    let mut bench = Bench { monitor: bench.monitor.clone(), now: bench.now };
    bench.monitor.forget();
    bench.cycle([10; 6]);
    assert_eq!(bench.laws(), [Law::KnownFirst]);
    bench.monitor.forget();
    bench.prove(Joint::of::<3>());
    bench.cycle([20; 6]);
    assert_eq!(bench.laws(), []);
}

#[test]
fn i7_a_heartbeat_without_a_cycle_is_seen() {
    let mut bench = Bench::running();
    bench.now += 12_000;
    bench.sent(0x77F, &[5]);
    assert_eq!(bench.laws(), [Law::Heartbeat]);
}

#[test]
fn i8_writing_into_an_enabled_drive_is_seen_and_reading_it_is_not() {
    let mut bench = Bench::running();
    bench.heard(0x183, &[0x37, 0x02, 0, 0, 0, 0, 0, 0]);
    bench.sent(0x603, &[0x40, 0x03, 0x10, 1, 0, 0, 0, 0]);
    assert_eq!(bench.laws(), []);
    bench.sent(0x603, &[0x2B, 0x72, 0x60, 0, 0, 0, 0, 0]);
    assert_eq!(bench.laws(), [Law::HandsOff]);
}

#[test]
fn i8_an_enabled_drive_may_be_told_to_take_its_power_off_and_no_other_word() {
    for (word, laws) in [(0x00, vec![]), (0x0F, vec![Law::HandsOff]), (0x06, vec![Law::HandsOff])] {
        let mut bench = Bench::running();
        bench.heard(0x183, &[0x37, 0x02, 0, 0, 0, 0, 0, 0]);
        bench.sent(0x603, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]);
        assert_eq!(bench.laws(), laws, "{word:X}");
    }
}

#[test]
fn i9_an_identifier_of_nobody_is_seen() {
    for cob_id in [0x207, 0x181, 0x7E5, 0x607, 0x100] {
        let mut bench = Bench::running();
        bench.sent(cob_id, &[0; 8]);
        assert_eq!(bench.laws(), [Law::OwnIdentifiers], "{cob_id:X}");
    }
}

#[test]
fn i10_cycles_that_are_made_up_for_are_seen_and_one_that_is_late_is_not() {
    let mut bench = Bench::running();
    bench.now += 10_000;
    bench.cycle([0; 6]);
    bench.now = bench.now.next_multiple_of(PERIOD) + PERIOD / 2;
    bench.sent(0x80, &[]);
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    bench.cycle([0; 6]);
    assert_eq!(bench.laws(), []);
    let mut bench = Bench::running();
    for _ in 0..3 {
        bench.sent(0x80, &[]);
        (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    }
    assert_eq!(bench.laws(), [Law::NoBurst]);
    let mut bench = Bench::running();
    bench.now = bench.now.next_multiple_of(PERIOD) + 5 * PERIOD;
    for _ in 0..5 {
        bench.now += PERIOD / 2;
        bench.sent(0x80, &[]);
        (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    }
    assert_eq!(bench.laws(), [Law::NoBurst], "nor at twice the rate");
}

#[test]
fn i11_a_joint_that_still_pushes_when_another_was_torn_off_is_seen() {
    let mut bench = Bench::pushing();
    bench.cycle([320, 0, 320, 320, 320, 320]);
    assert_eq!(bench.laws(), []);
    let mut other = Bench { monitor: bench.monitor.clone(), now: bench.now };
    other.cycle([0; 6]);
    assert_eq!((other.laws(), other.monitor.spread()), (vec![], Some(1)));
    (0..2).for_each(|_| bench.cycle([320, 0, 320, 320, 320, 320]));
    assert_eq!(bench.laws(), [Law::Together]);
}

#[test]
fn i12_disabling_under_torque_or_nmt_before_disabling_is_seen() {
    let mut bench = Bench::pushing();
    bench.cycle_of([320; 6], 0);
    assert_eq!(bench.laws(), [Law::Shutdown]);
    for command in [0x02, 0x80, 0x81, 0x82] {
        let mut bench = Bench::running();
        bench.sent(0, &[command, 3]);
        assert_eq!(bench.laws(), [Law::Shutdown], "{command:X}");
    }
}

#[test]
fn what_is_past_is_forgotten_and_what_is_known_stays() {
    let mut bench = Bench::running();
    bench.cycle([0, 0, 1, 0, 0, 0]);
    bench.monitor.forget();
    assert_eq!((bench.laws(), bench.monitor.unarmed_frames()), (vec![], 0));
    bench.cycle([0; 6]);
    assert_eq!(bench.laws(), [], "it is still started");
    let since = bench.monitor.all_zero_since().unwrap();
    assert!(since.since(Instant::ZERO) > Duration::from_millis(100));
}
