//! Another master or tool on the bus (hazard 26): its downloads and heartbeats stop the node, its uploads are counted.

use crate::common::prelude::*;

use crate::drive_hazards::{arm, armed, bench_of, foreign_frame, writes};
use canopen_device::station::Station;
use faults::Disturbance;

/// Gives the elbow's drive an SDO request that the node does not receive. The node does not receive the response
/// either if `is_lost`.
fn download_unseen(bench: &mut Bench<Wire>, request: [u8; 8], is_lost: bool) {
    let now = bench.node().bus().now();
    let drive = bench.world_mut().drive_mut(ELBOW).unwrap();
    let mut replies = Vec::new();
    drive.on_frame(now, Channel(0), &Frame::new(0x603, request), &mut replies);
    assert_eq!(replies.len(), 1, "it responds at once");
    if !is_lost {
        let response = replies.remove(0).frame;
        let flood = Disturbance::Flood(response);
        bench.bus_mut().disturb(Channel(0), Some(flood));
        bench.cycle();
        bench.bus_mut().disturb(Channel(0), None);
    }
}

#[test]
fn hazard_26_download_by_another_client_switches_all_off() {
    let timer = "2B00140500000000";
    let by_blocks = "C2501F0100000000";
    for (cob_id, payload) in [("0x603", timer), ("0x603", by_blocks), ("0x610", timer)] {
        let fault = foreign_frame("0.9", cob_id, payload);
        let (mut bench, _) = bench_of(&config(KRAFT), &fault, &[]);
        bench.bring_up().unwrap();
        arm(&mut bench);
        let begun =
            bench.node().bus().stations().scenario_start().unwrap() + Duration::from_millis(900);
        let record = until(&mut bench, |record| record.mode.is_stopped());
        assert_eq!(record.cause, Some(Cause::ForeignMaster), "{cob_id} {payload}");
        assert_eq!((record.mode, record.targets), (Mode::DrivesOff, [0; 6]));
        assert!(record.at.since(begun) <= Duration::from_millis(2));
    }
}

#[test]
fn hazard_26_own_heartbeat_from_another_node_switches_all_off() {
    let text = fs::read_to_string(KRAFT).unwrap();
    let moved = text.replace("node_id = 127 ", "node_id = 126 ");
    assert_ne!(moved, text);
    for (text, own, others) in [(&text, "0x77F", "0x77E"), (&moved, "0x77E", "0x77F")] {
        let config = parse(KRAFT, text);
        for (cob_id, is_ours) in [(own, true), (others, false)] {
            let fault = foreign_frame("0.9", cob_id, "05");
            let (mut bench, _) = bench_of(&config, &fault, &[]);
            bench.bring_up().unwrap();
            arm(&mut bench);
            let start = bench.node().bus().stations().scenario_start().unwrap();
            let from = start + Duration::from_millis(900);
            let end = from + Duration::from_millis(2);
            let mut record = bench.cycle();
            while record.at < end && record.cause.is_none() {
                record = bench.cycle();
            }
            let cause = is_ours.then_some(Cause::ForeignMaster);
            assert_eq!(record.cause, cause, "{cob_id}, own {own}");
            if is_ours {
                assert!(
                    record.at + config.period >= from && record.mode == Mode::DrivesOff,
                    "{record:?}"
                );
                assert_eq!(record.targets, [0; 6]);
            }
        }
    }
}

#[test]
fn hazard_26_foreign_download_response_switches_all_off() {
    let (mut bench, _) = armed();
    download_unseen(&mut bench, [0x2B, 0x00, 0x14, 5, 5, 0, 0, 0], false);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    assert_eq!(record.cause, Some(Cause::ForeignMaster), "the response alone was received");
}

#[test]
fn hazard_26_uploads_by_another_client_are_only_counted() {
    let reads: String = (0..50)
        .map(|n| {
            foreign_frame(&format!("{:.3}", 0.7 + 0.01 * f64::from(n)), "0x603", "4041600000000000")
        })
        .collect();
    let (mut bench, wire) = bench_of(&config(KRAFT), &reads, &[]);
    bench.bring_up().unwrap();
    arm(&mut bench);
    bench.run(1_500);
    let record = bench.cycle();
    assert_eq!((record.cause, record.mode), (None, Mode::Armed));
    assert_eq!((record.sdo.foreign_uploads, record.sdo.unread_settings), (50, 0));
    let reports = std::iter::from_fn(|| bench.next_event()).map(|event| event.to_string());
    let reports = reports.filter(|report| report.starts_with("another SDO client reads")).count();
    assert_eq!(reports, 1, "reported once");
    assert!(writes(&wire).is_empty());
}

#[test]
fn hazard_26_changed_timer_is_detected_by_read_back() {
    let (mut bench, wire) = bench_of(&config(KRAFT), "", &[]);
    bench.bring_up().unwrap();
    let begun = bench.node().bus().now();
    download_unseen(&mut bench, [0x2B, 0x00, 0x14, 5, 0, 0, 0, 0], true);
    let record = until(&mut bench, |record| record.mode.is_stopped());
    let object = Object::rpdo_communication(1, 5);
    let (node, expected, found) = (ELBOW.into(), 5, 0);
    let cause = Cause::SettingChanged { node, object, expected, found };
    assert_eq!((record.cause, record.mode), (Some(cause), Mode::DrivesOff));
    assert_eq!(cause.to_string(), "joint 3: 1400h:5 is 0h, was 5h at boot");
    assert!(record.at.since(begun) <= Duration::from_secs(7), "six drives, one per second");
    let asked = (0x601..=0x606).flat_map(|cob_id| wire.since(begun, cob_id)).count();
    assert_eq!(asked, 3, "one object per second");
    bench.run(10);
    bench.ask(Request::Reset).unwrap();
    assert_eq!(bench.node().mode(), Mode::Ready, "booted, configured and tested again");
}

#[test]
fn hazard_26_unreadable_setting_is_reported_and_counted() {
    let (mut bench, _) = bench_of(
        &config(KRAFT),
        "[[fault]]\nat_s = 1.0\nkind = \"drop\"\njoint = 3\nframe = \"sdo\"\n",
        &[],
    );
    bench.bring_up().unwrap();
    while bench.next_event().is_some() {}
    bench.run(4_500);
    let record = bench.cycle();
    assert_eq!((record.cause, record.mode, record.sdo.unread_settings), (None, Mode::Ready, 1));
    let reports: Vec<_> =
        std::iter::from_fn(|| bench.next_event()).map(|it| it.to_string()).collect();
    assert_eq!(reports, ["1400h:5 cannot be read again: no answer"]);
}
