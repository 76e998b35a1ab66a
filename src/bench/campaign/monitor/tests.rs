//! Monitor: every violated invariant is reported, and none in a correct run.

mod guarding;

use std::path::Path;
use std::time::Duration;

use super::*;
use bus::Tap;
use canopen::bits;
use canopen::frame::Frame;
use units::numbering::Joint;

/// Period in µs: 500 Hz, with one RPDO of controlword and target for each drive.
const PERIOD: u64 = 2_000;

const ENABLE: u16 = 0x000F;

struct Bench {
    monitor: Monitor,
    now: u64,
}

impl Bench {
    /// Returns a bench whose nodes are identified and started, after 20 cycles with zero targets.
    fn running() -> Self {
        let mut bench = Self::cold();
        (1..=6).chain([16]).for_each(|node| bench.identify(node));
        (1..=6).chain([16]).for_each(|node| bench.sent(0, &[1, node]));
        Joint::ALL.into_iter().for_each(|joint| bench.prove(joint));
        (0..20).for_each(|_| bench.cycle([0; 6]));
        bench
    }

    /// Returns a running bench that is armed, with the deadman pressed afterwards.
    fn engaged() -> Self {
        let mut bench = Self::running();
        bench.received(0x190, &[0b10]);
        bench.answer(Answer::Armed);
        bench.cycle([0; 6]);
        bench.received(0x190, &[0b01]);
        bench
    }

    /// Returns an engaged bench with torque on every joint.
    fn pushing() -> Self {
        let mut bench = Self::engaged();
        (1..=16).for_each(|step| bench.cycle([20 * step; 6]));
        assert_eq!(bench.violated(), []);
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

    /// Has the bus accept a frame, which is not on the wire yet.
    fn taken(&mut self, cob_id: u16, data: &[u8]) -> Telegram {
        let telegram = self.telegram(cob_id, data);
        self.monitor.on_taken(Instant::from_micros(self.now), &telegram);
        telegram
    }

    /// Puts an accepted frame on the wire.
    fn comes(&mut self, telegram: Telegram) {
        self.now += 10;
        self.monitor.on_sent(Instant::from_micros(self.now), &telegram);
    }

    /// Sends the EMCYs of a drive for missing RPDOs and missing heartbeats.
    fn prove(&mut self, joint: Joint) {
        let emergency = self.monitor.sheet.nodes[joint.index()].emergency;
        [0x50, 0x30].into_iter().zip([0x82, 0x81]).for_each(|(low, high)| {
            self.received(emergency, &[low, high, 0x11, 0, 0, 0, 0, 0]);
        });
    }

    fn received(&mut self, cob_id: u16, data: &[u8]) {
        let telegram = self.telegram(cob_id, data);
        self.monitor.on_wire(Instant::from_micros(self.now), &telegram);
    }

    fn telegram(&mut self, cob_id: u16, data: &[u8]) -> Telegram {
        self.now += 10;
        Telegram { channel: Channel(0), frame: Frame::from_slice(cob_id, data).unwrap() }
    }

    fn answer(&mut self, answer: Answer) {
        self.monitor.on_answer(Instant::from_micros(self.now), answer);
    }

    fn target(&mut self, node: u16, word: u16, target: i16) {
        let ([a, b], [c, d]) = (word.to_le_bytes(), target.to_le_bytes());
        self.sent(0x200 + node, &[a, b, c, d]);
    }

    /// Sends SYNC and six targets, with all drives enabled.
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

    /// Reads the identity of a node.
    fn identify(&mut self, node: u8) {
        let product: u32 = if node == 16 { 0x0401_0008 } else { 0x0402_0010 };
        for (sub, value) in [(1, 0x0F8C), (2, product), (3, 0x0001_0000)] {
            let [a, b, c, d] = u32::to_le_bytes(value);
            self.sent(0x600 + u16::from(node), &[0x40, 0x18, 0x10, sub, 0, 0, 0, 0]);
            self.received(0x580 + u16::from(node), &[0x43, 0x18, 0x10, sub, a, b, c, d]);
        }
    }

    /// Returns the violated invariants, each once.
    fn violated(&self) -> Vec<Invariant> {
        let mut all: Vec<Invariant> =
            self.monitor.violations().iter().map(|one| one.invariant).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

#[test]
fn correct_run_violates_no_invariant() {
    let mut bench = Bench::pushing();
    bench.sent(0x77F, &[5]);
    bench.received(0x190, &[0b10]);
    (0..15).rev().for_each(|step| bench.cycle([20 * step; 6]));
    bench.answer(Answer::Disarmed);
    (0..5).for_each(|_| bench.cycle([0; 6]));
    bench.cycle_of([0; 6], 0);
    bench.sent(0, &[0x80, 3]);
    assert_eq!(bench.violated(), []);
    assert_eq!((bench.monitor.unarmed_frames(), bench.monitor.stale_targets()), (0, 0));
}

#[test]
fn i1_target_beyond_capacity_is_reported() {
    let mut bench = Bench::pushing();
    bench.cycle([0, 0, 0, 0, 0, 900]);
    assert!(bench.violated().contains(&Invariant::Cap), "{:?}", bench.monitor.violations());
}

#[test]
fn i2_growing_too_fast_is_reported_and_shrinking_is_not() {
    let mut bench = Bench::pushing();
    bench.cycle([320, 320, 320, 320, 320, 200]);
    assert_eq!(bench.violated(), []);
    bench.cycle([320, 460, 320, 320, 320, 200]);
    assert_eq!(bench.violated(), [Invariant::Slew]);
    let mut bench = Bench::pushing();
    bench.cycle([320, -150, 320, 320, 320, 320]);
    assert_eq!(bench.violated(), [Invariant::Slew], "nor may it change its sign faster");
}

#[test]
fn i3_torque_without_arming_is_reported() {
    let mut bench = Bench::running();
    bench.cycle([0, 0, 1, 0, 0, 0]);
    assert_eq!((bench.violated(), bench.monitor.unarmed_frames()), (vec![Invariant::Permitted], 1));
}

#[test]
fn i3_torque_50_ms_after_disarming_is_reported() {
    let mut bench = Bench::pushing();
    bench.answer(Answer::Disarmed);
    (0..25).for_each(|_| bench.cycle([10; 6]));
    assert_eq!(bench.violated(), [], "gravity compensation may ramp to zero");
    (0..2).for_each(|_| bench.cycle([10; 6]));
    assert_eq!(bench.violated(), [Invariant::Permitted]);
}

#[test]
fn i3_more_than_the_weight_with_an_open_deadman_is_reported() {
    let mut bench = Bench::pushing();
    bench.received(0x190, &[0b10]);
    (0..10).for_each(|_| bench.cycle([320; 6]));
    assert_eq!(bench.violated(), [], "reflection may end by a ramp");
    (0..8).for_each(|_| bench.cycle([320; 6]));
    assert_eq!(bench.violated(), [Invariant::Permitted]);
}

/// Plays deadman states for a time in ms each; the mode is engaged at the end of the last.
fn engaged_after(states: &[(u8, u64)]) -> Vec<Invariant> {
    let mut bench = Bench::running();
    bench.received(0x190, &[0b10]);
    bench.answer(Answer::Armed);
    for (contacts, millis) in states {
        bench.received(0x190, &[*contacts]);
        bench.monitor.on_mode(Instant::from_micros(bench.now), ModeClass::Other);
        bench.now += 1_000 * millis;
    }
    bench.monitor.on_mode(Instant::from_micros(bench.now), ModeClass::Engaged);
    bench.violated()
}

#[test]
fn i3_engagement_by_an_unsettled_deadman_is_reported() {
    assert_eq!(engaged_after(&[(0b10, 25), (0b01, 25)]), []);
    assert_eq!(
        engaged_after(&[(0b10, 25), (0b01, 20)]),
        [Invariant::Permitted],
        "closed too briefly"
    );
    assert_eq!(
        engaged_after(&[(0b10, 20), (0b01, 25)]),
        [Invariant::Permitted],
        "open too briefly"
    );
    let bounces = [(0b10, 25), (0b01, 24), (0b11, 1), (0b01, 20)];
    assert_eq!(engaged_after(&bounces), [Invariant::Permitted], "from the last bounce");
}

#[test]
fn i3_torque_with_disagreeing_deadman_channels_is_reported() {
    let mut bench = Bench::running();
    bench.received(0x190, &[0b10]);
    bench.answer(Answer::Armed);
    bench.received(0x190, &[0b11]);
    (1..=30).for_each(|step: i16| bench.cycle([0, 0, 0, 0, 0, 20 * step.min(16)]));
    assert_eq!(bench.violated(), [Invariant::Permitted]);
}

#[test]
fn i4_torque_after_a_stop_is_reported() {
    let mut bench = Bench::pushing();
    bench.monitor.on_mode(Instant::from_micros(bench.now), ModeClass::Stopped);
    bench.cycle([0; 6]);
    assert_eq!(bench.violated(), []);
    bench.cycle([0, 1, 0, 0, 0, 0]);
    assert!(bench.violated().contains(&Invariant::Latched));
}

#[test]
fn i4_held_back_target_of_a_drive_that_is_off_is_allowed() {
    let mut bench = Bench::pushing();
    bench.monitor.on_mode(Instant::from_micros(bench.now), ModeClass::Stopped);
    bench.cycle([0; 6]);
    (1..=6).for_each(|node| bench.received(0x180 + node, &[0x18, 0x02, 0, 0, 0, 0, 0, 0]));
    bench.cycle([20; 6]);
    assert_eq!(bench.violated(), []);
}

#[test]
fn i4_arming_without_reset_or_with_closed_deadman_is_reported() {
    let mut bench = Bench::pushing();
    bench.received(0x190, &[0b10]);
    bench.monitor.on_mode(Instant::from_micros(bench.now), ModeClass::Stopped);
    bench.answer(Answer::Armed);
    assert_eq!(bench.violated(), [Invariant::Latched]);
    let mut bench = Bench::running();
    bench.received(0x190, &[0b01]);
    bench.answer(Answer::Armed);
    assert_eq!(bench.violated(), [Invariant::Latched]);
}

#[test]
fn i5_missing_double_and_late_targets_are_reported() {
    let mut bench = Bench::running();
    bench.sent(0x80, &[]);
    (1..=5).for_each(|node| bench.target(node, ENABLE, 0));
    bench.cycle([0; 6]);
    assert!(bench.violated().contains(&Invariant::OncePerSync));
    let mut bench = Bench::running();
    bench.target(6, ENABLE, 0);
    bench.cycle([0; 6]);
    assert_eq!(bench.violated(), [Invariant::OncePerSync]);
    let mut bench = Bench::running();
    bench.now = bench.now.next_multiple_of(PERIOD);
    bench.sent(0x80, &[]);
    bench.now += 3_100;
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    assert_eq!(bench.violated(), [Invariant::OncePerSync]);
}

#[test]
fn i5_exempt_bus_may_miss_targets() {
    let mut bench = Bench::running();
    let now = Instant::from_micros(bench.now);
    bench.monitor.exempt(Exemption::Bus(Channel(0), now));
    bench.now = bench.now.next_multiple_of(PERIOD);
    bench.sent(0x80, &[]);
    bench.cycle([0; 6]);
    assert_eq!(bench.violated(), []);
}

#[test]
fn i5_exempt_process_may_send_zero_late_and_nothing_else() {
    for (target, laws) in [(0, vec![]), (1, vec![Invariant::OncePerSync])] {
        let mut bench = Bench::pushing();
        let now = Instant::from_micros(bench.now);
        bench.monitor.exempt(Exemption::Process(now, now + Duration::from_millis(20)));
        bench.now += 10_000;
        (1..=6).for_each(|node| bench.target(node, ENABLE, target));
        assert_eq!(bench.violated(), laws);
    }
    let mut bench = Bench::running();
    let now = Instant::from_micros(bench.now);
    bench.monitor.exempt(Exemption::Process(now, now + Duration::from_millis(1)));
    bench.now += 10_000;
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    assert_eq!(bench.violated(), [Invariant::OncePerSync], "not for ever");
}

/// Returns the joints whose targets were stale when they began to act.
fn stale_joints(monitor: &Monitor) -> [bool; 6] {
    monitor.acting_ages().map(|age| monitor.is_stale(age))
}

#[test]
fn held_back_target_is_judged_by_its_time_of_sending() {
    let mut bench = Bench::pushing();
    let now = Instant::from_micros(bench.now);
    bench.monitor.exempt(Exemption::Bus(Channel(0), now));
    let held = bench.taken(0x201, &[0x0F, 0, 100, 0]);
    bench.monitor.on_mode(Instant::from_micros(bench.now), ModeClass::Stopped);
    bench.now += 10_000;
    bench.comes(held);
    assert_eq!((bench.violated(), bench.monitor.stale_targets()), (vec![], 1));
    assert_eq!(stale_joints(&bench.monitor), [false; 6], "it acts at a SYNC");
    bench.sent(0x80, &[]);
    assert_eq!(
        stale_joints(&bench.monitor),
        [true; 6],
        "the others' as well: they waited for a SYNC"
    );
    let after = bench.taken(0x202, &[0x0F, 0, 100, 0]);
    bench.comes(after);
    assert!(bench.violated().contains(&Invariant::Latched), "sent after the stop");
    bench.target(1, ENABLE, 0);
    bench.sent(0x80, &[]);
    assert_eq!(stale_joints(&bench.monitor), [false, false, true, true, true, true]);
}

#[test]
fn i6_start_before_identity_and_read_back_is_reported() {
    let mut bench = Bench::cold();
    bench.sent(0, &[1, 3]);
    assert_eq!(bench.violated(), [Invariant::KnownFirst]);
    let mut bench = Bench::cold();
    bench.identify(3);
    bench.sent(0x603, &[0x2B, 0x17, 0x10, 0, 100, 0, 0, 0]);
    bench.received(0x583, &[0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    let mut other = Bench { monitor: bench.monitor.clone(), now: bench.now };
    bench.sent(0, &[1, 3]);
    assert_eq!(bench.violated(), [Invariant::KnownFirst], "written and not read back");
    other.sent(0x603, &[0x40, 0x17, 0x10, 0, 0, 0, 0, 0]);
    other.received(0x583, &[0x4B, 0x17, 0x10, 0, 100, 0, 0, 0]);
    other.sent(0, &[1, 3]);
    assert_eq!(other.violated(), []);
}

#[test]
fn i6_enabling_a_drive_that_was_not_started_is_reported() {
    let mut bench = Bench::running();
    bench.received(0x703, &[0]);
    bench.cycle([0; 6]);
    assert_eq!(bench.violated(), [], "the frame was on its way");
    (0..2).for_each(|_| bench.cycle([0; 6]));
    assert_eq!(bench.violated(), [Invariant::KnownFirst], "it has booted since");
    bench.sent(0, &[1, 3]);
    let last = bench.monitor.violations().last().map(|one| one.what.clone());
    let why = "node 3 is started before its identity was read";
    assert_eq!(last.as_deref(), Some(why), "and must be identified again");
}

#[test]
fn i6_torque_before_the_proof_test_is_reported() {
    let mut bench = Bench::engaged();
    bench.sent(0, &[0x81, 3]);
    bench.received(0x703, &[0]);
    bench.identify(3);
    bench.sent(0, &[1, 3]);
    bench.now += 10 * PERIOD;
    let mut bench = Bench { monitor: bench.monitor.clone(), now: bench.now };
    bench.monitor.forget();
    bench.cycle([10; 6]);
    assert_eq!(bench.violated(), [Invariant::KnownFirst]);
    bench.monitor.forget();
    bench.prove(Joint::of::<3>());
    bench.cycle([20; 6]);
    assert_eq!(bench.violated(), []);
}

#[test]
fn i7_heartbeat_without_a_cycle_is_reported() {
    let mut bench = Bench::running();
    bench.now += 12_000;
    bench.sent(0x77F, &[5]);
    assert_eq!(bench.violated(), [Invariant::Heartbeat]);
}

#[test]
fn i7_heartbeat_after_pre_operational_needs_no_cycle() {
    let mut bench = Bench::running();
    bench.cycle_of([0; 6], 0);
    bench.sent(0, &[0x80, 0]);
    bench.now += 12_000;
    bench.sent(0x77F, &[5]);
    assert_eq!(bench.violated(), []);
}

#[test]
fn i7_heartbeat_of_a_process_that_has_stood_still_needs_no_sync() {
    let mut bench = Bench::running();
    let now = Instant::from_micros(bench.now);
    bench.monitor.exempt(Exemption::Process(now, now + Duration::from_millis(13)));
    bench.now += 12_000;
    bench.sent(0x77F, &[5]);
    assert_eq!(bench.violated(), []);
    bench.now += 12_000;
    bench.sent(0x77F, &[5]);
    assert_eq!(bench.violated(), [Invariant::Heartbeat]);
}

#[test]
fn i8_download_to_an_enabled_drive_is_reported_upload_is_not() {
    let mut bench = Bench::running();
    bench.received(0x183, &[0x37, 0x02, 0, 0, 0, 0, 0, 0]);
    bench.sent(0x603, &[0x40, 0x03, 0x10, 1, 0, 0, 0, 0]);
    assert_eq!(bench.violated(), []);
    bench.sent(0x603, &[0x2B, 0x72, 0x60, 0, 0, 0, 0, 0]);
    assert_eq!(bench.violated(), [Invariant::HandsOff]);
}

#[test]
fn i8_enabled_drive_may_be_switched_off_by_sdo_alone() {
    for (word, laws) in
        [(0x00, vec![]), (0x0F, vec![Invariant::HandsOff]), (0x06, vec![Invariant::HandsOff])]
    {
        let mut bench = Bench::running();
        bench.received(0x183, &[0x37, 0x02, 0, 0, 0, 0, 0, 0]);
        bench.sent(0x603, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]);
        assert_eq!(bench.violated(), laws, "{word:X}");
    }
}

#[test]
fn i9_cob_id_that_is_not_configured_is_reported() {
    for cob_id in [0x207, 0x181, 0x7E5, 0x607, 0x100] {
        let mut bench = Bench::running();
        bench.sent(cob_id, &[0; 8]);
        assert_eq!(bench.violated(), [Invariant::OwnIdentifiers], "{cob_id:X}");
    }
}

#[test]
fn i10_burst_of_cycles_is_reported_and_a_late_one_is_not() {
    let mut bench = Bench::running();
    bench.now += 10_000;
    bench.cycle([0; 6]);
    bench.now = bench.now.next_multiple_of(PERIOD) + PERIOD / 2;
    bench.sent(0x80, &[]);
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    bench.cycle([0; 6]);
    assert_eq!(bench.violated(), []);
    let mut bench = Bench::running();
    for _ in 0..3 {
        bench.sent(0x80, &[]);
        (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    }
    assert_eq!(bench.violated(), [Invariant::NoBurst]);
    let mut bench = Bench::running();
    bench.now = bench.now.next_multiple_of(PERIOD) + 5 * PERIOD;
    for _ in 0..5 {
        bench.now += PERIOD / 2;
        bench.sent(0x80, &[]);
        (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    }
    assert_eq!(bench.violated(), [Invariant::NoBurst], "nor at twice the rate");
}

/// Puts a SYNC on the wire a tenth of a period before the next one is accepted. Other frames keep the wire busy in between,
/// except for `gap` µs.
fn held(mut bench: Bench, gap: u64) -> Bench {
    bench.now = bench.now.next_multiple_of(PERIOD);
    let next = bench.now + PERIOD;
    let held = bench.taken(0x80, &[]);
    bench.now += gap;
    while bench.now < next - PERIOD / 10 {
        let other = bench.telegram(0x300, &[0xAA; 8]);
        bench.now += u64::from(bits::exact(&other.frame)) - 10;
        bench.monitor.on_wire(Instant::from_micros(bench.now), &other);
    }
    bench.now += u64::from(bits::exact(&held.frame)) - 10;
    bench.comes(held);
    (1..=6).for_each(|node| bench.target(node, ENABLE, 0));
    assert!(bench.now < next);
    bench.now = next;
    bench.sent(0x80, &[]);
    bench
}

/// Running bench whose adapter is disturbed.
fn disturbed() -> Bench {
    let mut bench = Bench::running();
    let from = Instant::from_micros(bench.now);
    bench.monitor.exempt(Exemption::Bus(Channel(0), from));
    bench
}

#[test]
fn i10_sync_held_by_the_wire_alone_is_no_burst() {
    assert_eq!(held(Bench::running(), 0).violated(), []);
    assert_eq!(held(Bench::running(), 20).violated(), [Invariant::NoBurst], "nothing held it");
    assert_eq!(held(disturbed(), 20).violated(), [], "the adapter held it");
}

#[test]
fn i10_syncs_handed_over_too_closely_are_a_burst() {
    for mut bench in [Bench::running(), disturbed()] {
        bench.now = bench.now.next_multiple_of(PERIOD);
        let held = bench.taken(0x80, &[]);
        bench.now += PERIOD / 2 - 20;
        bench.taken(0x80, &[]);
        assert_eq!(bench.violated(), [Invariant::NoBurst]);
        let what = bench.monitor.violations().iter().map(|violation| violation.what.as_str());
        assert_eq!(what.collect::<Vec<_>>(), ["2 SYNCs handed over within 990µs"]);
        bench.comes(held);
    }
}

#[test]
fn i10_syncs_that_wait_together_are_a_burst() {
    for mut bench in [Bench::running(), disturbed()] {
        bench.now = bench.now.next_multiple_of(PERIOD);
        let mut held = vec![bench.taken(0x80, &[])];
        held.extend((1..=6).map(|node| bench.taken(0x200 + node, &[0x0F, 0, 0, 0])));
        bench.now += PERIOD;
        held.push(bench.taken(0x80, &[]));
        assert_eq!(bench.violated(), []);
        held.into_iter().for_each(|held| bench.comes(held));
        assert!(bench.violated().contains(&Invariant::NoBurst), "{:?}", bench.violated());
    }
}

#[test]
fn i11_torque_after_another_joint_was_cut_is_reported() {
    let mut bench = Bench::pushing();
    bench.cycle([320, 0, 320, 320, 320, 320]);
    assert_eq!(bench.violated(), []);
    let mut other = Bench { monitor: bench.monitor.clone(), now: bench.now };
    other.cycle([0; 6]);
    assert_eq!((other.violated(), other.monitor.spread()), (vec![], Some(1)));
    (0..2).for_each(|_| bench.cycle([320, 0, 320, 320, 320, 320]));
    assert_eq!(bench.violated(), [Invariant::Together]);
}

#[test]
fn i12_disabling_under_torque_or_nmt_before_it_is_reported() {
    let mut bench = Bench::pushing();
    bench.cycle_of([320; 6], 0);
    assert_eq!(bench.violated(), [Invariant::Shutdown]);
    for command in [0x02, 0x80, 0x81, 0x82] {
        let mut bench = Bench::running();
        bench.sent(0, &[command, 3]);
        assert_eq!(bench.violated(), [Invariant::Shutdown], "{command:X}");
    }
}

#[test]
fn forgotten_violations_leave_the_state_of_the_network() {
    let mut bench = Bench::running();
    bench.cycle([0, 0, 1, 0, 0, 0]);
    bench.monitor.forget();
    assert_eq!((bench.violated(), bench.monitor.unarmed_frames()), (vec![], 0));
    bench.cycle([0; 6]);
    assert_eq!(bench.violated(), [], "it is still started");
    let since = bench.monitor.all_zero_since().unwrap();
    assert!(since.since(Instant::ZERO) > Duration::from_millis(100));
}
