//! Frames of other masters and tools on the bus: hazard 26.

use crate::common::log::Entry;
use crate::common::process::Process;
use crate::gateway::{Gateway, NODE};
use crate::inject::{BUS, foreign};
use crate::interface::Interface;
use crate::rig::{Rig, Setup, cycles, millis};

/// An interface of the node that takes CAN FD, for cangen.
const OPEN: &str = "vcan2";

/// Frames that are not CANopen, with any identifier: 29 bits, remote, CAN FD.
const NOT_CANOPEN: [&str; 3] = ["-e -I 183 -L 4", "-R -I 183 -L 4", "-f -I 183 -L 4"];

/// Sends `count` frames, five a millisecond; `words` has identifiers and data.
fn flood(words: &str, count: u32) -> Process {
    let words = format!("{OPEN} -g 0.2 -i -n {count} {words}");
    Process::start("cangen", &words.split(' ').collect::<Vec<_>>())
}

#[test]
fn hazard_26_frames_that_are_not_canopen_change_nothing() {
    let _interface = Interface::vcan(OPEN);
    let gateway = Gateway::at(OPEN);
    let mut rig = Rig::engaged("not-canopen", &Setup { node: OPEN, ..Setup::default() });
    let before = rig.status()["status"]["missing_samples"].clone();
    for words in NOT_CANOPEN {
        flood(words, 200).wait().succeeds();
    }
    rig.run_for(millis(5));
    let after = rig.status();
    assert!(matches!(after["mode"].as_str(), Some("engaged" | "armed")), "{after}");
    assert_eq!(after["status"]["missing_samples"], before);
    gateway.is_gone();
}

#[test]
fn hazard_26_frame_of_another_master_ends_all_in_two_cycles() {
    let gateway = Gateway::at(NODE);
    // A forged heartbeat of the node would keep drives enabled after its end if they monitor nothing else.
    for (name, frame) in [("sync", "080#"), ("nmt", "000#0103"), ("heartbeat", "77F#05")] {
        let mut rig = Rig::engaged(name, &Setup::default());
        let onset = rig.onset();
        rig.inject(&gateway, BUS, foreign(frame));
        rig.run_for(millis(10));
        rig.is_stopped_by("another master");
        let seen = rig.seen_after(onset, millis(20));
        seen.all_are_free_within(cycles(2));
        seen.all_are_switched_off();
    }
}

#[test]
fn hazard_26_foreign_download_switches_all_off_in_two_cycles() {
    let gateway = Gateway::at(NODE);
    for tool in ["cansend", "frhc"] {
        let mut rig = Rig::engaged(tool, &Setup::default());
        let onset = rig.onset();
        match tool {
            "cansend" => rig.inject(&gateway, BUS, foreign("603#2B00140500000000")),
            _ => rig.tool("sdo write 3 1400:5 u16 0 --force").succeeds(),
        }
        rig.run_for(millis(10));
        rig.is_stopped_by("another master");
        let seen = rig.seen_after(onset, millis(20));
        let is_download = |entry: &Entry| entry.id == 0x603 && entry.data[0] == 0x2B;
        let seen = seen.from(is_download);
        seen.all_are_free_within(cycles(2));
        seen.all_are_switched_off();
    }
}

#[test]
fn hazard_26_tools_refuse_to_command_beside_a_node_and_may_read() {
    let _gateway = Gateway::at(NODE);
    let rig = Rig::engaged("tools", &Setup::default());
    for words in [
        "sdo write 3 1400:5 u16 0",
        "nmt preop 3",
        "nmt reset all",
        "lss configure --global --yes --node-id 9",
        "lss select 1 2 3 4",
    ] {
        let refused = rig.tool(words);
        assert_eq!(refused.code, Some(4), "{words}: {}", refused.stderr);
        let reason = "vcan0: a master sends SYNC on this bus";
        assert!(refused.stderr.contains(reason), "{words}: {}", refused.stderr);
    }
    rig.tool("sdo read 3 1400:5 u16").succeeds();
    rig.tool("sdo read 3 1008 --block").succeeds();
    rig.tool("scan").succeeds();
    let status = rig.status();
    assert!(matches!(status["mode"].as_str(), Some("engaged" | "armed")), "{status}");
    assert!(status["status"]["foreign_uploads"].as_u64().unwrap() > 7, "{status}");
}

#[test]
fn hazard_08_heartbeat_with_state_stopped_stops_all() {
    let gateway = Gateway::at(NODE);
    let mut rig = Rig::engaged("stopped", &Setup::default());
    let onset = rig.onset();
    rig.inject(&gateway, BUS, foreign("702#04"));
    rig.run_for(millis(10));
    rig.is_stopped_by("joint 2 (elevation): left operational, is stopped");
    let seen = rig.seen_after(onset, millis(20));
    seen.all_are_free_within(cycles(3));
}

#[test]
fn hazard_26_flood_of_random_frames_keeps_targets_within_bounds() {
    let _interface = Interface::vcan(OPEN);
    let gateway = Gateway::at(OPEN);
    let mut rig = Rig::engaged("flood", &Setup { node: OPEN, ..Setup::default() });
    let onset = rig.onset();
    flood("-m -I r -L r -D r", 300).wait().succeeds();
    flood("-I 000 -L r -D r", 50).wait().succeeds();
    rig.run_for(millis(10));
    rig.is_stopped();
    let seen = rig.seen_after(onset, millis(100));
    seen.targets_are_within_bounds();
    gateway.is_gone();
}
