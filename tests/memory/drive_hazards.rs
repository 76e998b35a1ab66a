//! Faults of a drive, and drives without their master: hazards 1 to 17 as far as they concern drives, and the proof
//! test at every power-up.

use crate::common::prelude::*;
use canopen_rs::NmtState;

pub(crate) fn bench_of(config: &Config, faults: &str, quirks: &[&str]) -> (Bench<Wire>, Wire) {
    crate::common::bench::bench_of(config, &format!("seconds = 9\n{faults}"), quirks)
}

/// Returns an armed node with gravity compensation, 0.3 s after arming.
pub(crate) fn armed() -> (Bench<Wire>, Wire) {
    let (mut bench, wire) = bench_of(&config(KRAFT), "", &[]);
    bench.bring_up().unwrap();
    arm(&mut bench);
    wire.clear();
    (bench, wire)
}

pub(crate) fn arm(bench: &mut Bench<Wire>) {
    bench.run(20);
    bench.ask(Request::Arm).unwrap();
    bench.run(280);
    assert!(has_torque(&bench.cycle()), "gravity compensation");
}

fn has_torque(record: &Record) -> bool {
    record.targets != [0; 6]
}

/// Returns the cycles until all targets are zero, and the record of the last of them.
fn cycles_to_zero(bench: &mut Bench<Wire>) -> (usize, Record) {
    let mut cycles = 0;
    loop {
        let record = bench.cycle();
        if !has_torque(&record) {
            return (cycles, record);
        }
        cycles += 1;
        assert!(cycles < 1_000, "targets stay: {:?}", record.cause);
    }
}

fn is_enabled(bench: &mut Bench<Wire>) -> [bool; 6] {
    bench.world_mut().drives().each_ref().map(|drive| drive.state() == State::OperationEnabled)
}

/// Returns the SDO downloads after the first SYNC.
pub(crate) fn writes(wire: &Wire) -> Vec<Frame> {
    let all = wire.all();
    let since = all.iter().position(|(_, telegram)| telegram.frame.cob_id == 0x80).unwrap();
    let is_write = |frame: &Frame| {
        frame.cob_id & 0x780 == 0x600 && frame.data().first().is_some_and(|it| it >> 5 == 1)
    };
    let frames = all[since..].iter().map(|(_, telegram)| telegram.frame);
    frames.filter(is_write).collect()
}

/// Scenario fault: a frame from an unknown station, `at_s` seconds after the first SYNC.
pub(crate) fn foreign_frame(at_s: &str, cob_id: &str, payload: &str) -> String {
    format!(
        "[[fault]]\nat_s = {at_s}\nkind = \"foreign_frame\"\ncob_id = {cob_id}\npayload = \"{payload}\"\n"
    )
}

#[test]
fn promise_03_every_drive_timer_is_proven_before_arming() {
    for file in [KRAFT, JPL] {
        let (mut bench, wire) = bench_of(&config(file), "", &[]);
        bench.bring_up().unwrap();
        let report = bench.node().proof_test_report();
        assert_eq!(report.drives.len(), 6, "{file}");
        for drive in &report.drives {
            let (rpdo, heartbeat) = (drive.rpdo.unwrap(), drive.heartbeat.unwrap());
            assert!((5_000..7_500).contains(&rpdo.measured.as_micros()), "{file}: {rpdo:?}");
            assert!(
                (22_000..25_000).contains(&heartbeat.measured.as_micros()),
                "{file}: {heartbeat:?}"
            );
            assert!(drive.missing.is_empty());
        }
        assert!(report.reaction_time().unwrap() < Duration::from_micros(7_500), "{file}");
        let first = wire.since(Instant::ZERO, 0x80)[0].0;
        let took = bench.node().bus().now().since(first);
        assert!(
            took < Duration::from_millis(700),
            "{file}: enabled, tested twice, ready: {took:?}"
        );
    }
}

#[test]
fn promise_09_targets_are_zero_and_start_follows_read_back() {
    let (mut bench, wire) = bench_of(&config(KRAFT), "", &[]);
    bench.bring_up().unwrap();
    bench.run(100);
    for (at, telegram) in wire.all() {
        let frame = telegram.frame;
        let is_target = matches!(frame.cob_id, 0x201 | 0x204);
        assert!(!is_target || frame.data() == [0; 6], "{at:?} {frame}");
    }
    let started = wire.since(Instant::ZERO, 0).into_iter().find(|(_, it)| it.data()[0] == 1);
    let (started, _) = started.unwrap();
    let asked = (0x601..=0x606).flat_map(|cob_id| wire.since(Instant::ZERO, cob_id));
    assert!(
        asked.filter(|(at, _)| *at > started).all(|(_, it)| it.data()[0] == 0x40),
        "uploads only"
    );
}

#[test]
fn hazard_01_lost_drive_is_switched_off_by_sdo() {
    let (mut bench, wire) = armed();
    bench.world_mut().drive_mut(ELBOW).unwrap().unplug();
    let (cycles, record) = cycles_to_zero(&mut bench);
    assert_eq!(record.cause, Some(Cause::SamplesMissing { joint: ELBOW, cycles: 3 }));
    assert_eq!(record.mode, Mode::ZeroTorque);
    assert!(cycles <= 5, "{cycles}");
    bench.run(130);
    assert_eq!(bench.node().mode(), Mode::DrivesOff);
    assert_eq!(is_enabled(&mut bench), [false; 6]);
    assert_eq!(writes(&wire), [Frame::new(0x603, [0x2B, 0x40, 0x60, 0, 0, 0, 0, 0])], "I8");
}

#[test]
fn hazard_01_drive_without_syncs_ends_torque_with_the_others() {
    let fault = "[[fault]]\nat_s = 0.9\nkind = \"drop\"\njoint = 3\nframe = \"sync\"\n";
    let (mut bench, _) = bench_of(&config(KRAFT), fault, &[]);
    bench.bring_up().unwrap();
    arm(&mut bench);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    assert!(matches!(record.cause, Some(Cause::SamplesMissing { joint: ELBOW, .. })));
    bench.run(3);
    assert!(bench.world_mut().drives().iter().all(|drive| drive.demand() == 0.0));
}

#[test]
fn hazard_02_missing_heartbeat_switches_all_off_in_252_ms() {
    let fault = "[[fault]]\nat_s = 0.9\nkind = \"heartbeat_stop\"\njoint = 3\n";
    let (mut bench, wire) = bench_of(&config(KRAFT), fault, &[]);
    bench.bring_up().unwrap();
    arm(&mut bench);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    assert_eq!(record.cause, Some(Cause::HeartbeatLost { node: ELBOW.into() }));
    assert_eq!((record.mode, record.targets), (Mode::DrivesOff, [0; 6]));
    let (last, _) = *wire.since(Instant::ZERO, 0x703).last().unwrap();
    let elapsed = record.at.since(last);
    assert!(elapsed <= Duration::from_millis(252), "{elapsed:?}");
}

#[test]
fn hazard_07_any_emergency_stops_all_within_two_cycles() {
    const CODES: [u16; 30] = [
        0x1000, 0x2110, 0x2120, 0x2130, 0x2220, 0x2310, 0x2320, 0x3110, 0x3120, 0x3210, 0x3220,
        0x3310, 0x4110, 0x4210, 0x4310, 0x5110, 0x5210, 0x5400, 0x6010, 0x6310, 0x7110, 0x7305,
        0x7310, 0x8110, 0x8120, 0x8130, 0x8250, 0x8611, 0x9000, 0xFF01,
    ];
    let (mut bench, _) = armed();
    for (place, code) in CODES.into_iter().enumerate() {
        let joint = Joint::at(place % 6).unwrap();
        bench.world_mut().drive_mut(joint).unwrap().report_transient_error(code, 0x01);
        let (cycles, record) = cycles_to_zero(&mut bench);
        let node = joint.into();
        assert_eq!(record.cause, Some(Cause::Emergency { node, code }), "{code:04X}h");
        assert!(cycles <= 2, "{code:04X}h: {cycles}");
        bench.run(20);
        let mut others = [true; 6];
        others[joint.index()] = false;
        assert_eq!(is_enabled(&mut bench), others, "{code:04X}h: S2, and S3 for that drive");
        bench.run(60);
        bench.ask(Request::Reset).unwrap();
        until(&mut bench, |record| record.mode == Mode::Ready);
        if code >> 8 == 0x73 {
            // A sensor fault makes the position doubtful: the arm must rest again.
            let rests = config(KRAFT).joints.each_ref().map(|joint| joint.rest.unwrap().position());
            bench.world_mut().guide_to(rests);
            bench.run(1_000);
        }
        bench.ask(Request::Arm).unwrap();
        bench.run(60);
    }
}

#[test]
fn hazard_08_non_operational_heartbeat_stops_all_in_2_cycles() {
    for (payload, state) in [("04", NmtState::Stopped), ("7F", NmtState::PreOperational)] {
        let fault = foreign_frame("0.9", "0x703", payload);
        let (mut bench, _) = bench_of(&config(KRAFT), &fault, &[]);
        bench.bring_up().unwrap();
        arm(&mut bench);
        let begun =
            bench.node().bus().stations().scenario_start().unwrap() + Duration::from_millis(900);
        let record = until(&mut bench, |record| record.mode.is_stopped());
        assert_eq!(record.cause, Some(Cause::LeftOperational { node: ELBOW.into(), state }));
        assert_eq!((record.mode, record.targets), (Mode::ZeroTorque, [0; 6]));
        assert!(record.at.since(begun) <= Duration::from_millis(2));
    }
}

/// Boots while the elbow's drive sends this emergency, `at_ms` after the first SYNC. Returns the events of that drive,
/// and whether the boot succeeded.
fn boot_with_emergency(code: u16, at_ms: u32) -> (Vec<String>, bool) {
    let at_s = f64::from(at_ms) * 1e-3;
    let fault =
        format!("[[fault]]\nat_s = {at_s:.3}\nkind = \"emergency\"\njoint = 3\ncode = {code}\n");
    let (mut bench, _) = bench_of(&config(KRAFT), &fault, &[]);
    let is_booted = bench.bring_up().is_ok();
    let events = std::iter::from_fn(|| bench.next_event());
    let reports =
        events.filter(|event| event.node() == Some(ELBOW.into())).map(|event| event.to_string());
    (reports.collect(), is_booted)
}

#[test]
fn hazard_07_emergency_during_the_proof_test_is_reported() {
    let mut is_stopped = [false; 2];
    for at_ms in [30, 55, 65, 75, 85] {
        let (reports, is_booted) = boot_with_emergency(0xFF42, at_ms);
        let is_reported = reports.iter().any(|report| report.starts_with("emergency FF42h"));
        assert!(is_reported, "{at_ms} ms: {reports:?}");
        is_stopped[usize::from(!is_booted)] = true;
    }
    assert_eq!(is_stopped, [true; 2], "some stop the boot and some do not");
}

#[test]
fn hazard_01_silent_bus_is_the_cause_rather_than_a_joint() {
    let unplugged = |joint| format!("[[fault]]\nat_s = 0.9\nkind = \"unplug\"\njoint = {joint}\n");
    let all: String = (1..=6).map(unplugged).collect();
    let (mut bench, _) = bench_of(&config(KRAFT), &all, &[]);
    bench.bring_up().unwrap();
    arm(&mut bench);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    let cause = Cause::BusSilent { channel: 0, cycles: 3 };
    assert_eq!((record.cause, record.mode), (Some(cause), Mode::ZeroTorque));
    assert_eq!(cause.to_string(), "bus 0: no sample of any drive for 3 cycles");
}

#[test]
fn arming_a_latched_node_is_refused_with_its_cause() {
    let (mut bench, _) = armed();
    bench.world_mut().drive_mut(ELBOW).unwrap().report_transient_error(0x3210, 1);
    until(&mut bench, |record| record.mode.is_stopped());
    let refused = bench.ask(Request::Arm).unwrap_err().to_string();
    assert!(refused.starts_with("stopped: joint 3: emergency 3210h"), "{refused}");
    assert!(refused.ends_with(". Run `frhc ctl reset` first"), "{refused}");
}

#[test]
fn hazard_09_rebooted_drive_switches_all_off_in_two_cycles() {
    let (mut bench, _) = armed();
    let now = bench.node().bus().now();
    bench.world_mut().drive_mut(ELBOW).unwrap().switch_on(now);
    let (cycles, record) = cycles_to_zero(&mut bench);
    assert_eq!(record.cause, Some(Cause::Rebooted { node: ELBOW.into() }));
    assert_eq!(record.mode, Mode::DrivesOff);
    assert!(cycles <= 2, "{cycles}");
    bench.run(40);
    bench.ask(Request::Reset).unwrap();
    assert_eq!(bench.node().proof_test_report().drives.len(), 6, "booted and tested again");
}

#[test]
fn hazard_13_drive_without_rpdos_disables_itself_in_6_ms() {
    let fault = "[[fault]]\nat_s = 0.9\nkind = \"drop\"\njoint = 3\nframe = \"rpdo1\"\n";
    let (mut bench, wire) = bench_of(&config(KRAFT), fault, &[]);
    bench.bring_up().unwrap();
    arm(&mut bench);
    let begun =
        bench.node().bus().stations().scenario_start().unwrap() + Duration::from_millis(900);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    assert_eq!(record.cause, Some(Cause::Emergency { node: ELBOW.into(), code: 0x8250 }));
    // The last RPDO arrived up to a cycle before the fault; the drive reports 8250h when it is torque-free.
    let emergency = wire.since(begun, 0x783);
    let reported = emergency.first().or(None).map(|(at, _)| *at);
    assert!(reported.is_none() || reported.unwrap().since(begun) <= Duration::from_millis(6));
    assert!(record.at.since(begun) <= Duration::from_millis(8), "{:?}", record.at.since(begun));
    assert_eq!(bench.world_mut().drives()[ELBOW.index()].demand(), 0.0);
}

#[test]
fn hazard_14_wrong_identity_is_refused_before_nmt_start() {
    let (mut bench, wire) = bench_of(&config(KRAFT), "", &["wrong-identity"]);
    let refused = bench.bring_up().unwrap_err().to_string();
    assert!(refused.starts_with("joint 3 (elbow), node 3: 1018h:2 is "), "{refused}");
    assert!(wire.since(Instant::ZERO, 0).iter().all(|(_, it)| it.data()[0] != 1), "NMT start");
}

#[test]
fn hazard_15_rejected_mapping_is_refused_before_nmt_start() {
    for (quirk, object) in
        [("fixed-mapping", "1A00h refused"), ("forgetful:1A00h:1", "1A00h:1 is ")]
    {
        let (mut bench, wire) = bench_of(&config(KRAFT), "", &[quirk]);
        let refused = bench.bring_up().unwrap_err().to_string();
        assert!(refused.starts_with(&format!("joint 3 (elbow), node 3: {object}")), "{refused}");
        assert!(wire.since(Instant::ZERO, 0).iter().all(|(_, it)| it.data()[0] != 1), "NMT start");
    }
}

#[test]
fn hazard_16_drives_with_heartbeat_only_need_a_lower_force_cap() {
    let text = fs::read_to_string(KRAFT).unwrap();
    let weak = text.replace("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 0 ");
    let refused = refusal(KRAFT, &weak);
    assert!(
        refused.contains("controller.max_force_n: 58.6 N (max_force_n 40.0, soft_stops.push"),
        "{refused}"
    );
    let weak = weak.replace("max_force_n = 40.0", "max_force_n = 13.0");
    let weak = weak.replace("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 30.0");
    let weak = weak.replace("push = 0.5 ", "push = 0.1 ");
    let (mut bench, _) = bench_of(&parse(KRAFT, &weak), "", &[]);
    bench.bring_up().unwrap();
    for drive in &bench.node().proof_test_report().drives {
        assert!(drive.rpdo.is_none() && drive.heartbeat.is_some());
    }
    arm(&mut bench);
}
