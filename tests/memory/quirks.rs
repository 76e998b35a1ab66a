//! Table of the master's reactions to the quirks of drives.
//!
//! Each quirk is given to the elbow's drive: once at 1 kHz with the targets of three drives in one frame, once at
//! 500 Hz with one frame per drive.

use crate::common::prelude::*;
use canopen_device::station::Station;

/// Arms immediately; closes the deadman 0.4 s after the first SYNC, when the drives are enabled.
const SCRIPT: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n";

/// Maximum cycles until the node is engaged.
const MAX_CYCLES_TO_ENGAGE: u32 = 500;

/// Result of a run.
#[derive(Clone, Copy, Debug)]
enum Outcome {
    /// The node boots, arms, engages and stops; drives apply the targets sent and no others.
    Runs,
    /// The boot fails for this reason before any drive is enabled.
    Refused(&'static str),
    /// The node boots; arming is refused for this reason.
    Unarmed(&'static str),
    /// The node boots; the proof test fails because the drive stays enabled without its master.
    NotProven(&'static str),
}

use Outcome::{NotProven, Refused, Runs, Unarmed};

/// Quirk, outcome at 1 kHz in groups, outcome at 500 Hz drive by drive.
const TABLE: &[(&str, Outcome, Outcome)] = &[
    ("deaf-to-master", Refused(DEAF), Refused(DEAF)),
    ("keeps-torque", Refused(KEEPS), Refused(KEEPS)),
    ("open-rpdos", Runs, Runs),
    ("holds-torque", NotProven(HOLDS), NotProven(HOLDS_500)),
    ("no-rpdo-timer", Unarmed(NO_TIMER), Unarmed(NO_TIMER_500)),
    ("slow-sdo:10", Runs, Runs),
    ("unsized-replies", Runs, Runs),
    ("fixed-mapping", Refused(FIXED), Refused(FIXED_500)),
    ("forgetful:6072h", Refused(MAX_TORQUE), Refused(MAX_TORQUE)),
    ("forgetful:605Eh", Refused(FAULT_REACTION), Refused(FAULT_REACTION)),
    ("forgetful:1400h:5", Refused(RPDO_TIMER), Refused(RPDO_TIMER_500)),
    ("forgetful:6060h", Refused(MODE), Refused(MODE)),
    ("running-at-start", Runs, Runs),
    ("late-boot:300", Runs, Runs),
    ("late-boot:2100", Refused(ABSENT), Refused(ABSENT)),
    ("no-boot-up", Refused(NO_BOOT_UP), Refused(NO_BOOT_UP)),
    // The drive's heartbeat of 100 ms satisfies the setting at 1 kHz, but not that at 500 Hz.
    ("heartbeat-liar", Runs, Refused("no heartbeat")),
    ("emcy-storm", Runs, Runs),
    ("double-replies", Refused(TWO), Refused(TWO)),
    ("vague-aborts", Runs, Runs),
    ("wrong-identity", Refused(OTHER), Refused(OTHER)),
    ("no-sync-counter", Runs, Runs),
    ("quiet-fault", Runs, Runs),
    ("no-rtr", Runs, Runs),
    ("lost-sdo-reply", Runs, Runs),
    ("polarity-reversed", Refused(POLARITY), Refused(POLARITY)),
    ("slow-first-answer:300", Runs, Runs),
    ("slow-first-answer:2100", Refused(ABSENT), Refused(ABSENT)),
    ("filtered-torque", Runs, Runs),
    ("filtered-torque:-5", Runs, Runs),
    ("stored:6091h:1=2", Refused(GEAR), Refused(GEAR)),
    ("stored:608Fh:1=32768", Refused(ENCODER), Refused(ENCODER)),
    ("stored:6076h=176500", Refused(TORQUE), Refused(TORQUE)),
    // It acts on velocities alone, of which the node neither reads nor writes one.
    ("stored:6090h:1=32768", Runs, Runs),
    ("stored:6092h:1=3600", Refused(FEED), Refused(FEED)),
    ("stored:6075h=2100", Refused(CURRENT), Refused(CURRENT)),
    ("stored:6502h=0x6D", Refused(MODES), Refused(MODES)),
    ("stored:60B2h=100", Runs, Runs),
    ("stored:60E0h=867", Refused(TORQUE_LIMIT), Refused(TORQUE_LIMIT)),
    ("stored:60A8h=FF410000h", Refused(POSITION_UNIT), Refused(POSITION_UNIT)),
    ("stored:60A9h=00B40300h", Refused(VELOCITY_UNIT), Refused(VELOCITY_UNIT)),
    // No acceleration is read or written.
    ("stored:60AAh=0", Runs, Runs),
    ("stored:607Bh:2=1000", Refused(RANGE), Refused(RANGE)),
    ("mode-when-operational", Runs, Runs),
    ("mode-when-enabled", Refused(MODE_HIDDEN), Refused(MODE_HIDDEN)),
    ("two-reset-edges", Runs, Runs),
    ("lost-write-reply", Runs, Runs),
    ("incremental", Unarmed(AT_ZERO), Unarmed(AT_ZERO)),
    ("encoder-slipped", Unarmed(SLIPPED), Unarmed(SLIPPED)),
    ("wrong-revolution", Unarmed(TURNED), Unarmed(TURNED)),
    ("homing-moves", Runs, Runs),
    ("referenced-bit", Runs, Runs),
    ("referenced-bit:14", Runs, Runs),
    ("referenced-bit:8", Runs, Runs),
];

const AT_ZERO: &str = "joint 3 (elbow): reads 2.1°, rest_deg is 95.0°, within 5.0°: at the first arming after a boot the arm must rest; \
    bring it there, or correct the sign of gear_ratio, encoder_counts_per_rev or zero_counts of the joint";
const SLIPPED: &str = "joint 3 (elbow): reads 115.0°, rest_deg is 95.0°, within 5.0°: at the first arming after a boot the arm must rest; \
    bring it there, or correct the sign of gear_ratio, encoder_counts_per_rev or zero_counts of the joint";
const TURNED: &str = "joint 3 (elbow): reads 105.0°, rest_deg is 95.0°, within 5.0°: at the first arming after a boot the arm must rest; \
    bring it there, or correct the sign of gear_ratio, encoder_counts_per_rev or zero_counts of the joint";
const DEAF: &str = "1016h:1 is 00000000h, expected 007F0016h";
const KEEPS: &str = "6007h is 0000h, expected 0001h";
const HOLDS: &str = "kept its power stage on for 40 ms without RPDOs (1400h:5 is 5 ms)";
const HOLDS_500: &str = "kept its power stage on for 43 ms without RPDOs (1400h:5 is 8 ms)";
const NO_TIMER: &str = "58.6 N (max_force_n 40.0, soft_stops.push 15.1, centring_n and walls 3.5) and \
    dampers of 83.0 N·s/m (passivity.max_damping_ns_per_m 75.0, damping_ns_per_m 8.0) for the 25.0 ms until a drive stops by \
    itself would make 1 kg of hand and grip 2.54 m/s fast, more than 0.5 m/s: these dampers leave no force; at most 20.0 N in \
    all with dampers of at most 40.0 N·s/m";
const NO_TIMER_500: &str = "49.5 N (max_force_n 40.0, soft_stops.push 6.0, centring_n and walls 3.5) and \
    dampers of 48.0 N·s/m (passivity.max_damping_ns_per_m 40.0, damping_ns_per_m 8.0) for the 25.0 ms until a drive stops by \
    itself would make 1 kg of hand and grip 1.44 m/s fast, more than 0.5 m/s: at most 11.9 N in all, or 20.0 N in all with \
    dampers of at most 40.0 N·s/m";
const FIXED: &str = "1A00h refused: 06010002h object is read only; 1A00h:1 is 60410010h, expected 60640020h: choose a \
    layout that the device has";
const FIXED_500: &str = "1A00h refused: 06010002h object is read only; 1A00h:2 is 00000000h, expected 60640020h: choose \
    a layout that the device has";
const MAX_TORQUE: &str = "6072h is 0BB8h, expected 0364h";
const FAULT_REACTION: &str = "605Eh is 0002h, expected 0000h";
const RPDO_TIMER: &str = "1400h:5 is 0000h, expected 0005h";
const RPDO_TIMER_500: &str = "1400h:5 is 0000h, expected 0008h";
const MODE: &str = "6060h is 00h, expected 0Ah";
const MODE_HIDDEN: &str = "6061h is 00h, expected 0Ah: if it displays its mode only when enabled, say mode_shown = \"enabled\" in \
    [joint.boot]";
const ABSENT: &str = "does not answer, waited 2.0 s";
const NO_BOOT_UP: &str = "did not boot up after its reset";
const TWO: &str = "answers one SDO request twice: are there two nodes with this node-id?";
const POLARITY: &str = "polarity (607Eh) is 80h, expected 00h: set it with the maker's tool or \
    [[joint.boot.write]], or state it as drive_polarity and check the sign of gear_ratio";
const GEAR: &str = "gear ratio (6091h) is 2:1, expected 1:1: set it with the maker's tool or [[joint.boot.write]], \
    or state it as drive_gear and give encoder_counts_per_rev in units of 6064h";
const ENCODER: &str = "encoder resolution (608Fh) is 32768:1, expected 16384:1 or 1:1: correct \
    encoder_counts_per_rev, or state the drive's value as drive_encoder";
const TORQUE: &str = "rated torque (6076h) is 176500 mN·m, expected 130.7 mN·m: set it with the maker's tool, or \
    correct rated_torque_nm or rated_torque_unit";
const FEED: &str = "feed constant (6092h) is 3600:1, expected 16384:1 or 1:1: set it with the maker's tool or \
    [[joint.boot.write]], or state it as drive_feed and give encoder_counts_per_rev in units of 6064h";
const CURRENT: &str = "rated current (6075h) is 2100 mA, expected 4200 mA: set it with the maker's tool, or correct \
    rated_current_a";
const MODES: &str = "supported modes (6502h) is 0000006Dh, expected bit 9: this drive lists no cyclic synchronous \
    torque; if it has it all the same, state its value as drive_modes";
const TORQUE_LIMIT: &str = "positive torque limit (60E0h) is 867 ‰, expected at least 868 ‰: raise it with the \
    maker's tool, or lower max_torque_nm (max_force_n of a sliding joint)";
const POSITION_UNIT: &str = "position unit (60A8h) is FF410000h (10^-1 °), expected 00B50000h (increments): set it with \
    the maker's tool or [[joint.boot.write]], or state it as drive_position_unit and give encoder_counts_per_rev in \
    units of 6064h";
const VELOCITY_UNIT: &str = "velocity unit (60A9h) is 00B40300h (revolutions/s), expected 00B44700h (rpm): set it with \
    the maker's tool or [[joint.boot.write]]: max_speed_rad_per_s (max_speed_m_per_s) is written to 6080h in rpm";
const RANGE: &str = "position range limit (607Bh) is 0 to 1000, expected at least -3400 to 225976: widen it, or set both to 0, \
    with the maker's tool or [[joint.boot.write]], or correct limit_deg (limit_m) or zero_counts";
const OTHER: &str = "1018h:2 is FBFDFFEFh, expected 04020010h";

/// The arm of `text`, whose elbow states its rated current.
fn config(text: &str) -> Config {
    let elbow = "rated_torque_nm = 0.1307";
    let text = text.replacen(elbow, &format!("{elbow}\nrated_current_a = 4.2"), 1);
    parse("config/test.toml", &text)
}

fn any_torque(bench: &mut Bench<Wire>) -> bool {
    bench.world_mut().drives().iter().any(|drive| drive.demand() != 0.0)
}

/// Counts the RPDOs of the master, and its controlwords by SDO other than Disable voltage (0000h).
fn commands(wire: &Wire) -> usize {
    let is_command = |frame: &Frame| {
        let of_rpdo = matches!(frame.cob_id & 0x780, 0x200 | 0x300 | 0x400 | 0x500)
            && !matches!(frame.cob_id, 0x281..=0x2FF | 0x381..=0x3FF | 0x481..=0x4FF);
        let of_sdo = frame.cob_id & 0x780 == 0x600
            && matches!(frame.data(), [0x2B, 0x40, 0x60, 0, word @ ..] if *word != [0; 4]);
        of_rpdo || of_sdo
    };
    wire.all().iter().filter(|(_, telegram)| is_command(&telegram.frame)).count()
}

/// Asserts [`Runs`].
fn runs(quirk: &str, mut bench: Bench<Wire>) {
    bench.bring_up().unwrap_or_else(|error| panic!("{quirk}: {error}"));
    for _ in 0..10 {
        let record = bench.cycle();
        assert_eq!(record.mode, Mode::Ready, "{quirk}: {:?}", record.cause);
        assert!(!any_torque(&mut bench), "{quirk}");
    }
    let engaged =
        (0..MAX_CYCLES_TO_ENGAGE).map(|_| bench.cycle()).find(|it| it.mode == Mode::Engaged);
    let mut sent = engaged.unwrap_or_else(|| panic!("{quirk}: it does not engage")).targets;
    for _ in 0..100 {
        let record = bench.cycle();
        assert_eq!((record.mode, record.cause), (Mode::Engaged, None), "{quirk}");
        let applied = |drive: &sim::drive::Drive| drive.dictionary().i16(Object::TARGET_TORQUE);
        assert_eq!(bench.world_mut().drives().each_ref().map(applied), sent, "{quirk}");
        sent = record.targets;
    }
    assert!(any_torque(&mut bench), "{quirk}: gravity compensation");
    bench.shut_down().unwrap_or_else(|error| panic!("{quirk}: {error}"));
    assert!(!any_torque(&mut bench), "{quirk}");
}

/// Asserts [`Refused`]: every drive is off and no command was sent.
fn is_refused(quirk: &str, reason: &str, mut bench: Bench<Wire>, wire: &Wire) {
    let Err(error) = bench.bring_up() else { panic!("{quirk}: it is accepted") };
    let error = error.to_string();
    assert_eq!(error, format!("joint 3 (elbow), node 3: {reason}"), "{quirk}");
    assert_eq!(commands(wire), 0, "{quirk}");
    for drive in bench.world_mut().drives() {
        assert_ne!(drive.state(), State::OperationEnabled, "{quirk}");
        assert_eq!(drive.demand(), 0.0, "{quirk}");
    }
}

/// Asserts [`Unarmed`].
fn is_not_armed(quirk: &str, reason: &str, mut bench: Bench<Wire>) {
    bench.bring_up().unwrap_or_else(|error| panic!("{quirk}: {error}"));
    let refused = bench.ask(Request::Arm).unwrap_err().to_string();
    assert_eq!(refused, reason, "{quirk}");
    assert_eq!(bench.node().mode(), Mode::Ready, "{quirk}");
}

/// Asserts [`NotProven`]: the targets were zero, and every drive is off.
fn is_not_proven(quirk: &str, reason: &str, mut bench: Bench<Wire>, wire: &Wire) {
    let Err(error) = bench.bring_up() else { panic!("{quirk}: it is accepted") };
    assert_eq!(error.to_string(), format!("joint 3 (elbow), node 3: {reason}"), "{quirk}");
    let is_target = |cob_id: u16| (0x201..=0x206).contains(&cob_id);
    for (_, telegram) in wire.all().iter().filter(|(_, it)| is_target(it.frame.cob_id)) {
        let data = telegram.frame.data();
        let targets = if data.len() == 6 { data } else { &data[2..] };
        assert!(targets.iter().all(|byte| *byte == 0), "{quirk}: {}", telegram.frame);
    }
    for drive in bench.world_mut().drives() {
        assert_ne!(drive.state(), State::OperationEnabled, "{quirk}");
        assert_eq!(drive.demand(), 0.0, "{quirk}");
    }
}

fn check_all(text: &str, outcome: impl Fn(&(&str, Outcome, Outcome)) -> Outcome) {
    let config = config(text);
    for row in TABLE {
        let (bench, wire) = bench_of(&config, SCRIPT, &[row.0]);
        match outcome(row) {
            Runs => runs(row.0, bench),
            Refused(reason) => is_refused(row.0, reason, bench, &wire),
            Unarmed(reason) => is_not_armed(row.0, reason, bench),
            NotProven(reason) => is_not_proven(row.0, reason, bench, &wire),
        }
    }
}

#[test]
fn hazard_16_quirks_at_1_khz_are_handled_or_refused() {
    check_all(KRAFT_TEXT, |row| row.1);
}

#[test]
fn hazard_16_quirks_at_500_hz_are_handled_or_refused() {
    check_all(KRAFT_500HZ_TEXT, |row| row.2);
}

#[test]
fn table_covers_all_quirks() {
    let is_listed = |name: &&str| TABLE.iter().any(|row| row.0.split(':').next() == Some(*name));
    let left: Vec<_> = Quirk::NAMES.iter().filter(|name| !is_listed(name)).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn sync_counter_missing_in_a_drive_is_refused_by_object() {
    let text = KRAFT_500HZ_TEXT.replace("node_id = 127 ", "sync_counter = 240\nnode_id = 127 ");
    let (bench, wire) = bench_of(&config(&text), SCRIPT, &["no-sync-counter"]);
    let reason = "1019h refused: 06020000h object does not exist";
    is_refused("no-sync-counter", reason, bench, &wire);
}

/// Returns the times of the first Disable voltage by SDO to the elbow's drive and of the first read of its identity.
fn off_and_identified(wire: &Wire) -> (Instant, Instant) {
    let requests = wire.since(Instant::ZERO, 0x603);
    let first = |start: &[u8]| {
        requests.iter().find(|(_, frame)| frame.data().starts_with(start)).unwrap().0
    };
    (first(&[0x2B, 0x40, 0x60, 0, 0, 0]), first(&[0x40, 0x18, 0x10]))
}

#[test]
fn hazard_17_enabled_drive_is_switched_off_first() {
    for text in [KRAFT_TEXT, KRAFT_500HZ_TEXT] {
        let (mut bench, wire) = bench_of(&config(text), SCRIPT, &["running-at-start"]);
        assert!(any_torque(&mut bench), "before the boot");
        bench.bring_up().unwrap();
        let (off, identified) = off_and_identified(&wire);
        assert!(off < identified, "before its identity is known");
        assert!(off.since(Instant::ZERO) < Duration::from_millis(25), "{off:?}");
        let notices: Vec<_> = std::iter::from_fn(|| bench.next_event()).collect();
        assert!(notices.contains(&Event::FoundEnabled { node: ELBOW.into() }));
    }
}

#[test]
fn boot_waits_for_a_falling_arm_to_stand_still() {
    let script = format!("{SCRIPT}[[hold]]\nat_s = 0\nholding = false\n");
    let (mut bench, wire) = bench_of(&config(KRAFT_500HZ_TEXT), &script, &["running-at-start:800"]);
    bench.bring_up().unwrap();
    let (off, identified) = off_and_identified(&wire);
    assert!(identified.since(off) > Duration::from_millis(600), "it was moving: {identified:?}");
    let speeds = bench.world_mut().plant().qd();
    assert!(speeds[ELBOW.index()].abs() < 0.02, "{speeds}");
}

#[test]
fn hazard_17_enabled_drive_is_off_even_if_then_refused() {
    for (quirk, reason) in [("wrong-identity", OTHER), ("double-replies", TWO)] {
        let (bench, wire) =
            bench_of(&config(KRAFT_500HZ_TEXT), SCRIPT, &["running-at-start", quirk]);
        is_refused(quirk, reason, bench, &wire);
    }
}

/// RPDO 3 of the elbow's drive with quirk `open-rpdos`: Enable operation and maximum torque.
const STRAY: (u16, [u8; 4]) = (0x403, [0x0F, 0x00, 0xE8, 0x03]);

#[test]
fn stray_rpdo_moves_nothing_after_the_boot() {
    for text in [KRAFT_TEXT, KRAFT_500HZ_TEXT] {
        let (mut bench, _) = bench_of(&config(text), SCRIPT, &["open-rpdos"]);
        bench.bring_up().unwrap();
        let now = bench.node().bus().now();
        let stray = Frame::new(STRAY.0, STRAY.1);
        let drive = bench.world_mut().drive_mut(ELBOW).unwrap();
        drive.on_frame(now, Channel(0), &stray, &mut Vec::new());
        for _ in 0..10 {
            assert!(!any_torque(&mut bench));
            assert_eq!(bench.cycle().cause, None);
        }
    }
}

#[test]
fn fault_without_emergency_is_seen_in_the_statusword() {
    let (mut bench, wire) = bench_of(&config(KRAFT_500HZ_TEXT), SCRIPT, &["quiet-fault"]);
    bench.bring_up().unwrap();
    until(&mut bench, |record| record.mode == Mode::Engaged);
    bench.world_mut().drive_mut(ELBOW).unwrap().fail_with(0x3210);
    let failed = bench.node().bus().now();
    let record = until(&mut bench, |record| record.mode.is_stopped());
    assert!(matches!(record.cause, Some(Cause::DriveLeft { joint: ELBOW, .. })));
    assert!(record.at.since(failed) <= Duration::from_millis(4));
    assert!(wire.since(failed, 0x683).is_empty());
}

#[test]
fn fixed_mapping_of_the_configured_layout_runs() {
    let mut quirks = vec!["fixed-mapping".to_owned()];
    for (mapping, entries) in [
        ("1600h", &[0x6040_0010, 0x6071_0010][..]),
        ("1A00h", &[0x6041_0010, 0x6064_0020, 0x6077_0010]),
    ] {
        quirks.push(format!("stored:{mapping}={}", entries.len()));
        let entries = (1..).zip(entries);
        quirks.extend(entries.map(|(sub, entry)| format!("stored:{mapping}:{sub}={entry:#x}")));
    }
    let quirks: Vec<_> = quirks.iter().map(String::as_str).collect();
    let (bench, wire) = bench_of(&config(KRAFT_500HZ_TEXT), SCRIPT, &quirks);
    runs("fixed-mapping", bench);
    let is_write = |frame: &Frame| matches!(frame.data(), [0x23, _, 0x16 | 0x1A, ..]);
    assert!(!wire.since(Instant::ZERO, 0x603).iter().any(|(_, frame)| is_write(frame)));
}

#[test]
fn quirks_in_scenario_and_command_line_are_equal() {
    let script = format!("{SCRIPT}[[drive]]\njoint = 3\nquirks = [\"keeps-torque\"]\n");
    let (bench, wire) = bench_of(&config(KRAFT_500HZ_TEXT), &script, &[]);
    is_refused("keeps-torque", KEEPS, bench, &wire);
}

#[test]
fn each_quirk_has_a_scenario() {
    for name in Quirk::NAMES {
        let file = format!("config/scenarios/quirks/{name}.toml");
        let script = script(&fs::read_to_string(&file).unwrap());
        let quirks: Vec<_> = script.quirks().for_joint(ELBOW).iter().collect();
        assert_eq!(quirks, [name.parse().unwrap()], "{file}");
    }
    let files = fs::read_dir("config/scenarios/quirks").unwrap();
    assert_eq!(files.count(), Quirk::NAMES.len(), "each file has a quirk");
}

#[test]
fn world_without_quirks_is_unchanged_bit_for_bit() {
    let frames = |script: &str| {
        let (mut bench, wire) = bench_of(&config(KRAFT_500HZ_TEXT), script, &[]);
        bench.bring_up().unwrap();
        bench.run(100);
        wire.all()
    };
    let named = format!("{SCRIPT}[[drive]]\njoint = 3\nquirks = []\n");
    assert!(frames(SCRIPT) == frames(&named));
}
