//! Emergencies: inhibit time, and lost heartbeats.

use super::*;

const WATCH_2: &str = "
[1016sub2]
ParameterName=Consumer heartbeat time 2
ObjectType=0x7
DataType=0x0007
AccessType=rw
";
const SECOND: Object = Object { sub: 2, ..Object::CONSUMER_HEARTBEAT };

const NONE: [u16; 0] = [];

fn code(frame: &Frame) -> u16 {
    u16::from_le_bytes([frame.data()[0], frame.data()[1]])
}

#[test]
fn emergencies_keep_their_inhibit_time() {
    let mut fixture = Fixture::new();
    fixture.write(Object::EMCY_INHIBIT_TIME, &[100, 0]).unwrap();
    let mut have = |code, millis| {
        fixture.device.touch(|application, _| application.code = code);
        fixture.wait_until(millis).iter().map(self::code).collect::<Vec<_>>()
    };
    assert_eq!(have(0x2310, 1), [0x2310]);
    assert_eq!(have(0x4310, 2), NONE);
    assert_eq!(have(0, 3), NONE);
    assert_eq!(have(0, 9), NONE);
    assert_eq!(have(0, 19), [0x4310], "10 ms after the first");
    assert_eq!(have(0, 21), [0], "and 10 ms after that");
    assert_eq!(have(0x3210, 29), NONE);
    assert_eq!(have(0x3210, 30), [0x3210]);
}

#[test]
fn full_emergency_queue_keeps_the_newest() {
    let mut fixture = Fixture::new();
    fixture.write(Object::EMCY_INHIBIT_TIME, &[10, 0]).unwrap();
    for number in 1..=100 {
        fixture.device.touch(|application, _| application.code = 0x2300 + number);
        fixture.device.on_time(fixture.now, &mut Vec::new());
    }
    let sent: Vec<_> = fixture.wait_until(1_000).iter().map(code).collect();
    assert_eq!(sent, (0x2300 + 85..=0x2300 + 100).collect::<Vec<_>>());
}

#[test]
fn stopped_node_drops_queued_emergencies() {
    let mut fixture = Fixture::new();
    fixture.write(Object::EMCY_INHIBIT_TIME, &[100, 0]).unwrap();
    for code in [0x2310, 0x4310] {
        fixture.device.touch(|application, _| application.code = code);
        fixture.wait_until(1);
    }
    fixture.order(NmtCommand::StopRemoteNode);
    assert_eq!(fixture.wait_until(100), []);
    fixture.order(NmtCommand::EnterPreOperational);
    assert_eq!(fixture.wait_until(200), []);
}

#[test]
fn every_monitored_heartbeat_can_be_lost() {
    let mut fixture =
        Fixture::described(&format!("{}{WATCH_2}", include_str!("../../../../eds/frhc_drive.eds")));
    fixture.write(Object::CONSUMER_HEARTBEAT, &MASTER_FOR_20_MS.to_le_bytes()).unwrap();
    fixture.write(SECOND, &0x0007_0032_u32.to_le_bytes()).unwrap();
    fixture.deliver(Frame::new(0x77F, [5]));
    fixture.deliver(Frame::new(0x707, [5]));
    assert_eq!(fixture.wait_until(20), [emergency(0x8130, 0x11, [1, 2, 3, 4, 5])]);
    assert_eq!(fixture.wait_until(50), [], "one emergency for both");
    assert_eq!(fixture.device.application().lost.len(), 2);
    assert_eq!(fixture.deliver(Frame::new(0x77F, [5])), [], "the other is still lost");
    assert_eq!(fixture.deliver(Frame::new(0x707, [5])), [emergency(0, 0, [0; 5])]);
}

#[test]
fn removed_consumer_entry_clears_its_error() {
    let mut fixture = Fixture::new();
    fixture.write(Object::CONSUMER_HEARTBEAT, &MASTER_FOR_20_MS.to_le_bytes()).unwrap();
    fixture.deliver(Frame::new(0x77F, [5]));
    fixture.wait_until(20);
    let clear = Frame::new(0x605, [0x23, 0x16, 0x10, 0x01, 0, 0, 0, 0]);
    assert!(fixture.deliver(clear).contains(&emergency(0, 0, [0; 5])));
}

#[test]
fn consumer_entry_without_time_or_node_is_unused() {
    for raw in [0x007F_0000_u32, 0x0000_0014, 0x0080_0014, 0x00FF_0014] {
        let mut fixture = Fixture::new();
        fixture.write(Object::CONSUMER_HEARTBEAT, &raw.to_le_bytes()).unwrap();
        fixture.deliver(Frame::new(0x77F, [5]));
        assert_eq!(fixture.wait_until(1_000), [], "{raw:X}h");
    }
}

#[test]
fn unchanged_consumer_entry_keeps_its_state() {
    let mut fixture = Fixture::new();
    let write = |fixture: &mut Fixture| {
        fixture.write(Object::CONSUMER_HEARTBEAT, &MASTER_FOR_20_MS.to_le_bytes()).unwrap();
    };
    write(&mut fixture);
    fixture.deliver(Frame::new(0x77F, [5]));
    fixture.wait_until(10);
    write(&mut fixture);
    assert_eq!(fixture.wait_until(20).len(), 1);
}

#[test]
fn enabled_heartbeat_ends_life_guarding() {
    let mut fixture = Fixture::silent();
    fixture.write(Object::GUARD_TIME, &[20, 0]).unwrap();
    fixture.write(Object::LIFE_TIME_FACTOR, &[3]).unwrap();
    fixture.deliver(Frame::remote(0x705, 1));
    fixture.write(Object::PRODUCER_HEARTBEAT, &[0xE8, 3]).unwrap();
    fixture.wait_until(100);
    assert_eq!(fixture.device.application().lost, []);
}

#[test]
fn guarding_poll_does_not_clear_a_lost_heartbeat() {
    let mut fixture = Fixture::silent();
    fixture.write(Object::CONSUMER_HEARTBEAT, &MASTER_FOR_20_MS.to_le_bytes()).unwrap();
    fixture.deliver(Frame::new(0x77F, [5]));
    assert_eq!(fixture.wait_until(20).len(), 1);
    assert_eq!(fixture.deliver(Frame::remote(0x705, 1)), [Frame::new(0x705, [0x7F])]);
}

#[test]
fn reset_drops_emergencies_and_consumer_states() {
    for command in [NmtCommand::ResetCommunication, NmtCommand::ResetNode] {
        let mut fixture = Fixture::new();
        fixture.write(Object::CONSUMER_HEARTBEAT, &MASTER_FOR_20_MS.to_le_bytes()).unwrap();
        fixture.write(Object::STORE_PARAMETERS, b"save").unwrap();
        fixture.deliver(Frame::new(0x77F, [5]));
        fixture.order(command);
        assert_eq!(
            fixture.wait_until(1_000),
            [],
            "a stored consumer entry starts with the next heartbeat"
        );
        fixture.deliver(Frame::new(0x77F, [5]));
        assert_eq!(fixture.wait_until(1_020).len(), 1);
    }
}
