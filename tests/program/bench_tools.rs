//! The bench tools against simulated devices, without SocketCAN: the same sessions and procedures that the
//! commands carry.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::process::Command;
use std::time::Duration;

use crate::common::bench::Wire;
use crate::common::devices::Devices;
use crate::common::devices::desk;
use bus::Memory;
use canopen::NmtCommand;
use canopen::NmtState;
use canopen::NodeId;
use canopen::abort::AbortCode;
use canopen::heartbeat;
use canopen::nmt::Order;
use canopen::object::Object;
use canopen::sdo::SdoError;
use canopen::sdo::Terms;
use canopen::value::gateway_type::GatewayType;
use canopen_tools::diagnostics::confirm::Confirmation;
use canopen_tools::diagnostics::scan::Found;
use canopen_tools::diagnostics::scan::Scan;
use canopen_tools::diagnostics::watch::NetworkEvent;
use canopen_tools::diagnostics::watch::Watch;
use frhc::cli::bench::Session;
use frhc::cli::bench::objects;
use frhc::cli::bench::objects::ObjectError;
use frhc::cli::bench::objects::Target;
use units::time::Instant;

type Desk = Session<Memory<Devices, Wire>>;

const TIMEOUT: Duration = Duration::from_millis(100);

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn at(node_id: u8, object: Object) -> Target {
    Target { node: node(node_id), object, terms: Terms::segmented(TIMEOUT) }
}

fn scan(desk: &mut Desk) -> Vec<Found> {
    let nodes: Vec<NodeId> = (1..=127).map(node).collect();
    let listen = Duration::from_millis(250);
    desk.run(|now, out| Scan::start(&nodes, TIMEOUT, listen, now, out)).unwrap()
}

fn order(desk: &mut Desk, command: NmtCommand, nodes: &[u8]) -> Vec<(u8, Option<NmtState>, bool)> {
    let nodes: Vec<NodeId> = nodes.iter().map(|raw| node(*raw)).collect();
    let order = Order::to_all(command);
    let heard = desk.run(|now, out| Confirmation::start(order, &nodes, TIMEOUT, now, out));
    heard.unwrap().iter().map(|heard| (heard.node.raw(), heard.state, heard.is_confirmed)).collect()
}

/// Every request there was to write.
fn writes(wire: &Wire) -> usize {
    let requests = (0x601..=0x67F).flat_map(|id| wire.since(Instant::ZERO, id));
    requests.filter(|(_, frame)| matches!(frame.data()[0] >> 5, 0 | 1)).count()
}

#[test]
fn a_scan_of_an_empty_bus_takes_less_than_a_second() {
    let (mut desk, wire) = desk(Devices::default());
    let begun = desk.now();
    assert_eq!(scan(&mut desk), []);
    let took = desk.now().since(begun);
    assert!(took < Duration::from_secs(1), "{took:?}");
    let requests = (0x601..=0x67F).map(|id| wire.since(Instant::ZERO, id));
    let reads = requests.map(|said| said.iter().filter(|(_, f)| f.data()[0] == 0x40).count());
    assert!(reads.eq([1; 127]), "each was asked once");
}

#[test]
fn a_full_bus_is_scanned_and_nothing_is_written() {
    let all: Vec<(u8, u32)> = (1..=127).map(|raw| (raw, 1_000 + u32::from(raw))).collect();
    let (mut desk, wire) = desk(Devices::of(&all));
    let found = scan(&mut desk);
    assert_eq!(found.len(), 127);
    for (found, (raw, serial)) in found.iter().zip(all) {
        assert_eq!((found.node.raw(), found.serial), (raw, Some(serial)));
        assert_eq!(found.device_type.map(|kind| kind & 0xFFFF), Some(402));
        assert_eq!(found.name.as_deref(), Some("frhc simulated drive"));
        assert!(found.answers && !found.is_duplicate(), "node {raw}");
    }
    assert_eq!(writes(&wire), 0);
}

#[test]
fn two_devices_of_one_node_id_are_told_apart_from_one() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1), (5, 2), (5, 3)]));
    let found = scan(&mut desk);
    let double: Vec<_> =
        found.iter().map(|found| (found.node.raw(), found.is_duplicate())).collect();
    assert_eq!(double, [(3, false), (5, true)]);
}

#[test]
fn a_scan_hears_states_and_who_does_not_answer() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1), (4, 2)]));
    for raw in [3, 4] {
        let heartbeat = at(raw, Object::PRODUCER_HEARTBEAT);
        objects::write(&mut desk, heartbeat, &50_u16.to_le_bytes(), true).unwrap();
    }
    let stop = Order::to(node(4), NmtCommand::StopRemoteNode);
    desk.say([stop.frame()]).unwrap();
    let found = scan(&mut desk);
    let told = |found: &Found| (found.node.raw(), found.answers, found.state);
    let expected = [(3, true, Some(NmtState::PreOperational)), (4, false, Some(NmtState::Stopped))];
    assert_eq!(found.iter().map(told).collect::<Vec<_>>(), expected);
}

#[test]
fn what_is_written_is_read_and_verified() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1)]));
    let torque = at(3, Object::TARGET_TORQUE);
    let data_type: GatewayType = "i16".parse().unwrap();
    let bytes = data_type.encode(&data_type.parse("-1000").unwrap());
    objects::write(&mut desk, torque, &bytes, true).unwrap();
    let content = objects::read(&mut desk, torque).unwrap();
    assert_eq!(data_type.decode(content.bytes()).unwrap().to_string(), "-1000");
    let name = objects::read(&mut desk, at(3, Object::DEVICE_NAME)).unwrap();
    assert_eq!(name.bytes(), b"frhc simulated drive");
}

#[test]
fn a_refusal_names_node_object_and_reason() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1)]));
    let refused = objects::write(&mut desk, at(3, Object::DEVICE_NAME), b"mine", false);
    let refused = refused.unwrap_err();
    let read_only = SdoError::AbortedByServer(AbortCode::READ_ONLY);
    let (node, object) = (node(3), Object::DEVICE_NAME);
    assert_eq!(refused, ObjectError::Node { node, object, error: read_only });
    assert_eq!(refused.to_string(), "node 3: 1008h refused: 06010002h object is read only");
    let silent = objects::read(&mut desk, at(4, Object::DEVICE_TYPE)).unwrap_err();
    assert_eq!(silent.to_string(), "node 4: 1000h: no answer");
}

#[test]
fn a_value_the_device_does_not_keep_is_no_success() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1)]));
    let speed = at(3, Object::MAX_MOTOR_SPEED);
    let value = 3_000_u32.to_le_bytes();
    assert_eq!(objects::write(&mut desk, speed, &value, false), Ok(()));
    let differs = objects::write(&mut desk, speed, &value, true).unwrap_err();
    assert_eq!(differs.to_string(), "node 3: 6080h is 00 00 00 00, expected B8 0B 00 00");
}

#[test]
fn resets_are_confirmed_by_boot_ups_and_states_by_heartbeats() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1), (4, 2)]));
    let booted = Some(NmtState::Initialising);
    let reset = order(&mut desk, NmtCommand::ResetNode, &[3, 4]);
    assert_eq!(reset, [(3, booted, true), (4, booted, true)]);
    let heartbeat = at(3, Object::PRODUCER_HEARTBEAT);
    objects::write(&mut desk, heartbeat, &20_u16.to_le_bytes(), false).unwrap();
    let operational = Some(NmtState::Operational);
    let started = order(&mut desk, NmtCommand::StartRemoteNode, &[3, 4]);
    assert_eq!(started, [(3, operational, true), (4, None, false)], "node 4 has no heartbeat");
    let heard = order(&mut desk, NmtCommand::StopRemoteNode, &[]);
    assert_eq!(heard, [(3, Some(NmtState::Stopped), true)]);
}

#[test]
fn a_watch_tells_what_changes_until_it_is_time() {
    let (mut desk, _) = desk(Devices::of(&[(3, 1)]));
    let until = desk.now() + Duration::from_millis(300);
    let mut watch = Watch::new(Duration::from_millis(100), Some(until));
    desk.queue([Order::to_all(NmtCommand::ResetNode).frame()]);
    let mut news = Vec::new();
    while let Some((_, what)) = desk.carry(&mut watch).unwrap() {
        news.push(what);
    }
    let beat = |news| NetworkEvent::Heartbeat(node(3), news);
    assert_eq!(
        news,
        [beat(heartbeat::HeartbeatEvent::BootedUp), beat(heartbeat::HeartbeatEvent::Lost)]
    );
    assert_eq!(desk.now(), until);
}

#[test]
fn what_is_typed_wrong_ends_with_2_before_any_bus_is_opened() {
    let config = ["--config", "config/kraft_like_500hz.toml"];
    let cases: [(&[&str], &str); 14] = [
        (&["scan"], "which bus?"),
        (&["scan", "-i", "can7", "--nodes", "0-3"], "not a node-id"),
        (&["sdo", "read", "0", "1000", "-i", "can7"], "not a node-id"),
        (&["sdo", "read", "3", "10000", "-i", "can7"], "not INDEX"),
        (&["sdo", "read", "3", "1000", "u7", "-i", "can7"], "no data type"),
        (
            &["sdo", "write", "3", "6071", "i16", "40000", "-i", "can7"],
            "must be within -32768..=32767",
        ),
        (&["sdo", "write", "3", "6071", "40", "-i", "can7"], "which type?"),
        (&["sdo", "write", "3", "6071", "3001"], "must be within -3000..=3000"),
        (&["sdo", "write", "3", "6071", "-3001"], "6071h (Target torque)"),
        (&["nmt", "start", "128", "-i", "can7"], "not a node-id"),
        (&["lss", "configure", "--node-id", "9", "-i", "can7"], "which slave?"),
        (&["lss", "configure", "--global", "--node-id", "9", "-i", "can7"], "--yes"),
        (&["lss", "set-bit-timing", "300", "-i", "can7"], "none of 1000"),
        (
            &["lss", "configure", "--select", "1,2,3", "--node-id", "9", "-i", "can7"],
            "four numbers",
        ),
    ];
    for (words, reason) in cases {
        let needs_config = words.starts_with(&["sdo", "write"]) && !words.contains(&"-i");
        let given = if needs_config { &config[..] } else { &[] };
        let program = crate::common::program();
        let ended = Command::new(program).args(words).args(given).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{words:?}: {stderr}");
        assert!(stderr.contains(reason), "{words:?}: {stderr}");
    }
}

#[test]
fn an_interface_that_is_not_there_ends_with_4() {
    for words in [
        &["scan"][..],
        &["sdo", "read", "3", "1000", "u32"],
        &["nmt", "start", "all"],
        &["lss", "inquire"],
    ] {
        let program = crate::common::program();
        let ended = Command::new(program).args(words).args(["-i", "nocan7"]).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(4), "{words:?}: {stderr}");
        assert!(stderr.starts_with("frhc: nocan7: "), "{words:?}: {stderr}");
    }
}
