//! SYNC and PDOs: windows, counters, remote frames, RPDO errors.

use super::*;

const HIGH_RESOLUTION: u32 = 0x1013_0020;
const RPDO2: Place = Place { direction: Direction::Receive, number: 2 };
const SYNC_ON_CHANGE: u8 = 0;
const SYNC_ON_REQUEST: u8 = 252;
const ON_REQUEST: u8 = 253;
const NO_REMOTE: u32 = 1 << 30;

/// Operational device with its position alone in TPDO1, of this transmission type.
fn with_position(transmission: u8) -> Fixture {
    let mut fixture = Fixture::silent();
    fixture.map(TPDO1, &[POSITION], transmission).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    fixture
}

impl Fixture {
    fn put(&mut self, position: u8) {
        self.device.touch(|_, dictionary| {
            assert!(dictionary.set(Object::POSITION_ACTUAL, &[position, 0, 0, 0]));
        });
    }

    fn count(&mut self, counter: u8) -> Vec<Frame> {
        self.deliver(Sync { counter: Some(counter) }.frame())
    }
}

fn tpdo(position: u8) -> [Frame; 1] {
    [Frame::new(TPDO, [position, 0, 0, 0])]
}

#[test]
fn rpdo_after_the_window_is_discarded_and_reported() {
    let mut fixture = Fixture::with_target(EVERY_SYNC);
    fixture.write(Object::SYNC_WINDOW, &2_000_u32.to_le_bytes()).unwrap();
    fixture.deliver(Frame::new(RPDO, [1, 0]));
    fixture.sync();
    assert_eq!(fixture.target(), 1, "before the first SYNC it is open");
    fixture.wait_until(2);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [2, 0])), [], "2 ms are within 2 ms");
    fixture.wait_until(3);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [3, 0])), [emergency(0x8200, 0x11, [0; 5])]);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [3, 0])), [], "reported once");
    fixture.wait_until(10);
    assert_eq!(fixture.sync(), []);
    assert_eq!(fixture.target(), 2);
    fixture.wait_until(11);
    fixture.deliver(Frame::new(RPDO, [4, 0]));
    fixture.wait_until(20);
    assert_eq!(fixture.sync(), [emergency(0, 0, [0; 5])]);
    assert_eq!(fixture.target(), 4);
}

#[test]
fn event_driven_rpdo_ignores_the_window() {
    let mut fixture = Fixture::with_target(AT_ONCE);
    fixture.write(Object::SYNC_WINDOW, &2_000_u32.to_le_bytes()).unwrap();
    fixture.sync();
    fixture.wait_until(5);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [3, 0])), []);
    assert_eq!(fixture.target(), 3);
}

#[test]
fn tpdo_after_the_window_is_discarded() {
    for (window, sent) in [(50_u32, vec![emergency(0x8200, 0x11, [0; 5])]), (60, tpdo(0).to_vec())]
    {
        let mut fixture = with_position(EVERY_SYNC);
        fixture.device.latency = Duration::from_micros(60);
        fixture.write(Object::SYNC_WINDOW, &window.to_le_bytes()).unwrap();
        assert_eq!(fixture.sync(), []);
        assert_eq!(fixture.wait_until(1), sent, "a window of {window} µs");
    }
}

#[test]
fn sync_start_value_sets_the_first_sync() {
    let mut fixture = Fixture::silent();
    fixture.write(Object::SYNC_OVERFLOW, &[12]).unwrap();
    fixture.write(TPDO1.communication(6), &[5]).unwrap();
    fixture.map(TPDO1, &[POSITION], 4).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    let counts: Vec<u8> = (3..=12).chain(1..=12).collect();
    let sent: Vec<u8> =
        counts.into_iter().filter(|counter| !fixture.count(*counter).is_empty()).collect();
    assert_eq!(sent, [8, 12, 4, 8, 12], "5 is the first, and every fourth is sent");
}

#[test]
fn sync_start_value_needs_a_counter() {
    let mut fixture = Fixture::silent();
    fixture.write(TPDO1.communication(6), &[5]).unwrap();
    fixture.map(TPDO1, &[POSITION], EVERY_SYNC).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    assert_eq!(fixture.sync(), tpdo(0));
}

#[test]
fn tpdo_of_type_0_is_sent_at_the_sync_after_a_change() {
    let mut fixture = with_position(SYNC_ON_CHANGE);
    fixture.put(1);
    assert_eq!(fixture.wait_until(5), [], "not before");
    assert_eq!(fixture.sync(), tpdo(1));
    assert_eq!(fixture.sync(), [], "nothing has changed");
    fixture.put(2);
    assert_eq!(fixture.sync(), tpdo(2));
}

#[test]
fn tpdo_answers_remote_frames_unless_bit_30_is_set() {
    let request = Frame::remote(TPDO, 4);
    for transmission in [AT_ONCE, ON_REQUEST, EVERY_SYNC] {
        let mut fixture = with_position(transmission);
        fixture.wait_until(1);
        fixture.put(7);
        assert!(fixture.deliver(request).contains(&tpdo(7)[0]), "type {transmission}");
        fixture.order(NmtCommand::EnterPreOperational);
        assert_eq!(fixture.deliver(request), [], "no PDO outside operational");
        fixture.order(NmtCommand::StartRemoteNode);
        fixture
            .write(TPDO1.communication(1), &(NO_REMOTE | u32::from(TPDO)).to_le_bytes())
            .unwrap();
        fixture.wait_until(2);
        assert_eq!(fixture.deliver(request), [], "bit 30");
    }
}

#[test]
fn tpdo_on_request_is_not_sent_by_itself() {
    for transmission in [SYNC_ON_REQUEST, ON_REQUEST] {
        let mut fixture = with_position(transmission);
        fixture.put(7);
        assert_eq!(fixture.sync(), []);
        assert_eq!(fixture.wait_until(100), []);
    }
}

#[test]
fn tpdo_of_type_252_answers_with_the_last_sample() {
    let mut fixture = with_position(SYNC_ON_REQUEST);
    fixture.put(7);
    fixture.sync();
    fixture.put(8);
    assert_eq!(fixture.deliver(Frame::remote(TPDO, 4)), tpdo(7));
    fixture.sync();
    assert_eq!(fixture.deliver(Frame::remote(TPDO, 4)), tpdo(8));
}

#[test]
fn pdo_without_objects_is_disabled() {
    let mut fixture = Fixture::silent();
    fixture.map(RPDO1, &[], AT_ONCE).unwrap();
    fixture.map(TPDO1, &[], EVERY_SYNC).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    assert_eq!(fixture.sync(), []);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [1, 0])), []);
    assert_eq!(fixture.deliver(Frame::remote(TPDO, 8)), []);
}

#[test]
fn errors_of_one_rpdo_survive_frames_of_another() {
    let mut fixture = Fixture::silent();
    fixture.map(RPDO1, &[TARGET], AT_ONCE).unwrap();
    fixture.write(RPDO1.communication(5), &[5, 0]).unwrap();
    fixture.write(RPDO2.mapping(0), &[0]).unwrap();
    fixture.write(RPDO2.mapping(1), &DUMMY_16.to_le_bytes()).unwrap();
    fixture.write(RPDO2.mapping(0), &[1]).unwrap();
    fixture.write(RPDO2.communication(1), &0x305_u32.to_le_bytes()).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    fixture.deliver(Frame::new(RPDO, [1, 0]));
    assert_eq!(fixture.wait_until(10), [emergency(0x8250, 0x11, [1, 2, 3, 4, 5])]);
    assert_eq!(fixture.deliver(Frame::new(0x305, [1, 0])), []);
    assert_eq!(fixture.deliver(Frame::new(0x305, [1])), [emergency(0x8210, 0x11, [0; 5])]);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [1, 0])), [], "the other is still too short");
    assert_eq!(fixture.deliver(Frame::new(0x305, [1, 0])), [emergency(0, 0, [0; 5])]);
}

#[test]
fn disabled_rpdo_clears_its_timeout() {
    let mut fixture = Fixture::with_target(AT_ONCE);
    fixture.write(RPDO1.communication(5), &[5, 0]).unwrap();
    fixture.deliver(Frame::new(RPDO, [1, 0]));
    fixture.wait_until(10);
    let off = Frame::new(0x605, [0x23, 0x00, 0x14, 0x01, 0x05, 0x02, 0x00, 0x80]);
    assert!(fixture.deliver(off).contains(&emergency(0, 0, [0; 5])));
}

#[test]
fn inhibit_time_of_an_rpdo_has_no_effect() {
    let mut fixture = Fixture::silent();
    fixture.write(RPDO1.communication(3), &[0x10, 0x27]).unwrap();
    fixture.map(RPDO1, &[TARGET], AT_ONCE).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    for target in [1, 2, 3] {
        fixture.deliver(Frame::new(RPDO, [target, 0]));
        assert_eq!(fixture.target(), i16::from(target));
    }
    assert_eq!(fixture.read(RPDO1.communication(3)), Ok(vec![0x10, 0x27]));
}

#[test]
fn running_clock_is_sampled_at_every_sync() {
    let mut fixture = Fixture::silent();
    fixture.map(TPDO1, &[HIGH_RESOLUTION], EVERY_SYNC).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    fixture.now = Instant::from_micros(0x1_0002_0304_0506);
    assert_eq!(fixture.sync(), [Frame::new(TPDO, [6, 5, 4, 3])], "modulo 2³² µs");
    fixture.wait_until(0x1_0002_0304_0507);
    assert_eq!(fixture.read(Object::HIGH_RESOLUTION_TIME), Ok(vec![6, 5, 4, 3]));
}
