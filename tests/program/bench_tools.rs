//! Bench tools with simulated devices, without SocketCAN: sessions and procedures of the commands.

use cli::live_bus::Session;
use cli::live_bus::objects::{self, ObjectError, Target};

use crate::common::devices::{Devices, session};
use crate::common::prelude::*;
use canopen::abort::AbortCode;
use canopen::nmt::Order;
use canopen::sdo::{SdoError, SdoOptions};
use canopen::{NmtCommand, NmtState, heartbeat};
use canopen_tools::diagnostics::confirm::Confirmation;
use canopen_tools::diagnostics::network_monitor::{NetworkEvent, NetworkMonitor};
use canopen_tools::diagnostics::scan::{NodeReport, Scan};
use canopen_tools::diagnostics::states::{Answer, States};
use canopen_tools::value::gateway_type::GatewayType;

type TestSession = Session<Memory<Devices, Wire>>;

const TIMEOUT: Duration = Duration::from_millis(100);

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn at(node_id: u8, object: Object) -> Target {
    Target { node: node(node_id), object, options: SdoOptions::segmented(TIMEOUT) }
}

fn scan(session: &mut TestSession) -> Vec<NodeReport> {
    let nodes: Vec<NodeId> = (1..=127).map(node).collect();
    let listen = Duration::from_millis(250);
    session.run(|now, out| Scan::start(&nodes, TIMEOUT, listen, now, out)).unwrap()
}

fn order(
    session: &mut TestSession,
    command: NmtCommand,
    nodes: &[u8],
) -> Vec<(u8, Option<NmtState>, bool)> {
    let nodes: Vec<NodeId> = nodes.iter().map(|raw| node(*raw)).collect();
    let order = Order::to_all(command);
    let responses = session.run(|now, out| Confirmation::start(order, &nodes, TIMEOUT, now, out));
    responses
        .unwrap()
        .iter()
        .map(|response| (response.node.raw(), response.state, response.is_confirmed))
        .collect()
}

/// Number of SDO download requests.
fn writes(wire: &Wire) -> usize {
    let requests = (0x601..=0x67F).flat_map(|id| wire.since(Instant::ZERO, id));
    requests.filter(|(_, frame)| matches!(frame.data()[0] >> 5, 0 | 1)).count()
}

#[test]
fn scan_of_an_empty_bus_takes_less_than_a_second() {
    let (mut session, wire) = session(Devices::default());
    let start = session.now();
    assert_eq!(scan(&mut session), []);
    let took = session.now().since(start);
    assert!(took < Duration::from_secs(1), "{took:?}");
    let requests = (0x601..=0x67F).map(|id| wire.since(Instant::ZERO, id));
    let reads = requests.map(|frames| frames.iter().filter(|(_, f)| f.data()[0] == 0x40).count());
    assert!(reads.eq([1; 127]), "one request per node");
}

#[test]
fn scan_of_a_full_bus_writes_nothing() {
    let all: Vec<(u8, u32)> = (1..=127).map(|raw| (raw, 1_000 + u32::from(raw))).collect();
    let (mut session, wire) = session(Devices::from_numbers(&all));
    let found = scan(&mut session);
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
fn scan_reports_duplicate_node_ids() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1), (5, 2), (5, 3)]));
    let found = scan(&mut session);
    let double: Vec<_> =
        found.iter().map(|found| (found.node.raw(), found.is_duplicate())).collect();
    assert_eq!(double, [(3, false), (5, true)]);
}

#[test]
fn scan_reports_states_and_nodes_without_reply() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1), (4, 2)]));
    for raw in [3, 4] {
        let heartbeat = at(raw, Object::PRODUCER_HEARTBEAT);
        objects::write(&mut session, heartbeat, &50_u16.to_le_bytes(), true).unwrap();
    }
    let stop = Order::to(node(4), NmtCommand::StopRemoteNode);
    session.send([stop.frame()]).unwrap();
    let found = scan(&mut session);
    let reports = |found: &NodeReport| (found.node.raw(), found.answers, found.state);
    let expected = [(3, true, Some(NmtState::PreOperational)), (4, false, Some(NmtState::Stopped))];
    assert_eq!(found.iter().map(reports).collect::<Vec<_>>(), expected);
}

#[test]
fn states_of_nodes_without_heartbeat_are_asked() {
    let (mut session, wire) = session(Devices::from_numbers(&[(3, 1), (4, 2), (5, 3)]));
    session.send([Order::to(node(4), NmtCommand::StartRemoteNode).frame()]).unwrap();
    for (object, value) in [(Object::GUARD_TIME, &[20, 0][..]), (Object::LIFE_TIME_FACTOR, &[3])] {
        objects::write(&mut session, at(5, object), value, true).unwrap();
    }
    let found = scan(&mut session);
    assert!(found.iter().all(|found| found.answers && found.state.is_none()));
    let nodes = [3, 4, 5].map(node);
    let answers = session.run(|now, out| States::start(nodes, TIMEOUT, now, out)).unwrap();
    let state = |node, state| (node, Answer::State(state));
    let [three, four, five] = nodes;
    let expected = [
        state(three, NmtState::PreOperational),
        state(four, NmtState::Operational),
        (five, Answer::LifeGuarding),
    ];
    assert_eq!(answers, expected);
    let polls = |id| wire.since(Instant::ZERO, id).iter().filter(|(_, it)| it.is_remote()).count();
    assert_eq!([polls(0x703), polls(0x704), polls(0x705)], [1, 1, 0]);
}

#[test]
fn written_value_is_read_back_and_verified() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1)]));
    let torque = at(3, Object::TARGET_TORQUE);
    let data_type: GatewayType = "i16".parse().unwrap();
    let bytes = data_type.encode(&data_type.parse("-1000").unwrap());
    objects::write(&mut session, torque, &bytes, true).unwrap();
    let content = objects::read(&mut session, torque).unwrap();
    assert_eq!(data_type.decode(content.bytes()).unwrap().to_string(), "-1000");
    let name = objects::read(&mut session, at(3, Object::DEVICE_NAME)).unwrap();
    assert_eq!(name.bytes(), b"frhc simulated drive");
}

#[test]
fn sdo_abort_names_node_object_and_reason() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1)]));
    let refused = objects::write(&mut session, at(3, Object::DEVICE_NAME), b"mine", false);
    let refused = refused.unwrap_err();
    let read_only = SdoError::AbortedByServer(AbortCode::READ_ONLY);
    let (node, object) = (node(3), Object::DEVICE_NAME);
    assert_eq!(refused, ObjectError::Node { node, object, error: read_only });
    assert_eq!(refused.to_string(), "node 3: 1008h refused: 06010002h object is read only");
    let silent = objects::read(&mut session, at(4, Object::DEVICE_TYPE)).unwrap_err();
    assert_eq!(silent.to_string(), "node 4: 1000h: no answer");
}

#[test]
fn value_that_the_device_does_not_keep_is_an_error() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1)]));
    let speed = at(3, Object::MAX_MOTOR_SPEED);
    let value = 3_000_u32.to_le_bytes();
    assert_eq!(objects::write(&mut session, speed, &value, false), Ok(()));
    let differs = objects::write(&mut session, speed, &value, true).unwrap_err();
    assert_eq!(differs.to_string(), "node 3: 6080h is 00 00 00 00, expected B8 0B 00 00");
}

#[test]
fn nmt_commands_are_confirmed_by_boot_up_or_heartbeat() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1), (4, 2)]));
    let booted = Some(NmtState::Initialising);
    let reset = order(&mut session, NmtCommand::ResetNode, &[3, 4]);
    assert_eq!(reset, [(3, booted, true), (4, booted, true)]);
    let heartbeat = at(3, Object::PRODUCER_HEARTBEAT);
    objects::write(&mut session, heartbeat, &20_u16.to_le_bytes(), false).unwrap();
    let operational = Some(NmtState::Operational);
    let started = order(&mut session, NmtCommand::StartRemoteNode, &[3, 4]);
    assert_eq!(started, [(3, operational, true), (4, None, false)], "node 4 has no heartbeat");
    let responses = order(&mut session, NmtCommand::StopRemoteNode, &[]);
    assert_eq!(responses, [(3, Some(NmtState::Stopped), true)]);
}

#[test]
fn watch_reports_changes_until_its_end() {
    let (mut session, _) = session(Devices::from_numbers(&[(3, 1)]));
    let until = session.now() + Duration::from_millis(300);
    let mut watch = NetworkMonitor::new(Duration::from_millis(100), Some(until));
    session.queue([Order::to_all(NmtCommand::ResetNode).frame()]);
    let mut events = Vec::new();
    while let Some((_, what)) = session.resume(&mut watch).unwrap() {
        events.push(what);
    }
    let beat = |event| NetworkEvent::Heartbeat(node(3), event);
    assert_eq!(
        events,
        [beat(heartbeat::HeartbeatEvent::BootedUp), beat(heartbeat::HeartbeatEvent::Lost)]
    );
    assert_eq!(session.now(), until);
}

#[test]
fn invalid_arguments_end_with_2_before_a_bus_is_opened() {
    let config = ["--config", KRAFT_500HZ];
    let cases: [(&[&str], &str); 19] = [
        (&["scan"], "no bus selected"),
        (&["scan", "-i", "can7", "--nodes", "0-3"], "node-id must be"),
        (&["sdo", "read", "0", "1000", "-i", "can7"], "node-id must be"),
        (&["sdo", "read", "3", "10000", "-i", "can7"], "expected INDEX"),
        (&["sdo", "read", "3", "1000", "u7", "-i", "can7"], "unknown data type"),
        (
            &["sdo", "write", "3", "6071", "i16", "40000", "-i", "can7"],
            "must be within -32768..=32767",
        ),
        (&["sdo", "write", "3", "6071", "40", "-i", "can7"], "type"),
        (&["sdo", "write", "3", "6071", "3001"], "must be within -3000..=3000"),
        (&["sdo", "write", "3", "6071", "-3001"], "6071h (Target torque)"),
        (&["nmt", "start", "128", "-i", "can7"], "node-id must be"),
        (&["nmt", "start", "elbow", "-i", "can7"], "or the name of a joint and --config FILE"),
        (
            &["sdo", "write", "elbo", "6071", "3"],
            "unknown node \"elbo\"; expected a node-id or one",
        ),
        (&["sdo", "write", "elbow", "6071", "3001"], "must be within -3000..=3000"),
        (&["scan", "-i", "can7", "--nodes", "1-3,elbow"], "unknown node \"elbow\""),
        (&["lss", "set-node-id", "elbow", "-i", "can7"], "unknown node \"elbow\""),
        (&["lss", "configure", "--node-id", "9", "-i", "can7"], "no slave selected"),
        (&["lss", "configure", "--global", "--node-id", "9", "-i", "can7"], "--yes"),
        (&["lss", "set-bit-timing", "300", "-i", "can7"], "must be 1000"),
        (
            &["lss", "configure", "--select", "1,2,3", "--node-id", "9", "-i", "can7"],
            "four numbers",
        ),
    ];
    for (args, reason) in cases {
        let needs_config = args.starts_with(&["sdo", "write"]) && !args.contains(&"-i");
        let given = if needs_config { &config[..] } else { &[] };
        let program = crate::common::program();
        let ended = Command::new(program).args(args).args(given).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{args:?}: {stderr}");
        assert!(stderr.contains(reason), "{args:?}: {stderr}");
    }
}

#[test]
fn missing_interface_ends_with_4() {
    for args in [
        &["scan"][..],
        &["sdo", "read", "3", "1000", "u32"],
        &["nmt", "start", "all"],
        &["lss", "inquire"],
    ] {
        let program = crate::common::program();
        let ended = Command::new(program).args(args).args(["-i", "nocan7"]).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(4), "{args:?}: {stderr}");
        assert!(stderr.starts_with("frhc: nocan7: "), "{args:?}: {stderr}");
    }
}
