//! PDOs: action, transmission and mapping (CiA 301, 7.2.2, 7.5.2.35 to 7.5.2.38).

use super::*;

#[test]
fn rpdo_acts_at_the_next_sync() {
    let mut fixture = Fixture::with_target(EVERY_SYNC);
    fixture.deliver(Frame::new(RPDO, [100, 0]));
    fixture.wait_until(3);
    assert_eq!(fixture.target(), 0, "held");
    fixture.sync();
    assert_eq!(fixture.target(), 100);
    fixture.deliver(Frame::new(RPDO, [7, 0]));
    fixture.deliver(Frame::new(RPDO, [8, 0]));
    assert_eq!(fixture.target(), 100);
    fixture.sync();
    assert_eq!(fixture.target(), 8, "the last one counts");
}

#[test]
fn sync_of_wrong_length_is_reported_and_ignored() {
    let mut fixture = Fixture::with_target(EVERY_SYNC);
    fixture.deliver(Frame::new(RPDO, [100, 0]));
    let sent = fixture.deliver(Frame::new(0x80, [7]));
    assert_eq!(sent, [emergency(0x8240, 0x11, [0; 5])]);
    assert_eq!(fixture.target(), 0);
    assert!(fixture.sync().contains(&emergency(0, 0, [0; 5])));
    assert_eq!(fixture.target(), 100);
}

#[test]
fn pdo_512_exists() {
    let text = include_str!("../../../../eds/frhc_drive.eds");
    let start = text.find("[1403]").unwrap();
    let communication = &text[start..text.find("[1600]").unwrap()];
    let start = text.find("[1603]").unwrap();
    let mapping = &text[start..text.find("[1800]").unwrap()];
    let last =
        format!("{communication}{mapping}").replace("[1403", "[15FF").replace("[1603", "[17FF");
    let mut fixture = Fixture::described(&format!("{text}\n{last}"));
    let place = Place { direction: Direction::Receive, number: 512 };
    fixture.map(place, &[0x6071_0010], 255).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    let cob_id = place.cob_id(fixture.device.dictionary()).unwrap();
    fixture.deliver(Frame::new(cob_id, [0x2C, 0x01]));
    assert_eq!(fixture.target(), 300);
}

#[test]
fn event_driven_rpdo_acts_at_once() {
    let mut fixture = Fixture::with_target(AT_ONCE);
    fixture.deliver(Frame::new(RPDO, [100, 0]));
    assert_eq!(fixture.target(), 100);
    fixture.deliver(Frame::new(RPDO, 3_001_i16.to_le_bytes()));
    assert_eq!(fixture.target(), 100, "a value outside its limits is not taken");
}

#[test]
fn held_rpdo_is_discarded_on_leaving_operational() {
    for command in [NmtCommand::EnterPreOperational, NmtCommand::StopRemoteNode] {
        let mut fixture = Fixture::with_target(EVERY_SYNC);
        fixture.deliver(Frame::new(RPDO, [100, 0]));
        fixture.order(command);
        fixture.sync();
        fixture.deliver(Frame::new(RPDO, [100, 0]));
        fixture.order(NmtCommand::StartRemoteNode);
        fixture.sync();
        assert_eq!(fixture.target(), 0);
    }
}

#[test]
fn group_drives_take_their_part_of_one_frame() {
    let mut fixture = Fixture::new();
    fixture.map(RPDO1, &[DUMMY_16, DUMMY_16, TARGET], EVERY_SYNC).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    fixture.deliver(Frame::new(RPDO, [1, 0, 2, 0, 3, 0]));
    fixture.sync();
    assert_eq!(fixture.target(), 3);
}

#[test]
fn rpdo_shorter_than_its_mapping_is_ignored() {
    for data in [vec![9], vec![]] {
        let mut fixture = Fixture::with_target(AT_ONCE);
        let frame = Frame::from_slice(RPDO, &data).unwrap();
        assert_eq!(fixture.deliver(frame), [emergency(0x8210, 0x11, [0; 5])]);
        assert_eq!(fixture.deliver(frame), [], "reported once");
        assert_eq!(fixture.target(), 0);
        assert_eq!(fixture.deliver(Frame::new(RPDO, [9, 0])), [emergency(0, 0, [0; 5])]);
        assert_eq!(fixture.target(), 9);
    }
}

#[test]
fn rpdo_longer_than_its_mapping_is_cut_and_reported() {
    let mut fixture = Fixture::with_target(AT_ONCE);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [9, 0, 7])), [emergency(0x8220, 0x11, [0; 5])]);
    assert_eq!(fixture.target(), 9);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [8, 0, 7, 7])), [], "reported once");
    assert_eq!(fixture.target(), 8);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [7])), [emergency(0x8210, 0x11, [0; 5])]);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [7, 0])), [emergency(0, 0, [0; 5])]);
}

#[test]
fn remap_while_valid_is_refused() {
    let mut fixture = Fixture::new();
    fixture.map(RPDO1, &[TARGET], EVERY_SYNC).unwrap();
    for (object, bytes) in [
        (RPDO1.mapping(0), vec![0]),
        (RPDO1.mapping(1), DUMMY_16.to_le_bytes().to_vec()),
        (RPDO1.communication(1), 0x305_u32.to_le_bytes().to_vec()),
    ] {
        assert_eq!(fixture.write(object, &bytes), Err(AbortCode::DEVICE_STATE), "{object}");
    }
    let off = (OFF | u32::from(RPDO)).to_le_bytes();
    fixture.write(RPDO1.communication(1), &off).unwrap();
    let entry = fixture.write(RPDO1.mapping(1), &DUMMY_16.to_le_bytes());
    assert_eq!(entry, Err(AbortCode::ACCESS_UNSUPPORTED), "while entries are counted");
    fixture.write(RPDO1.mapping(0), &[0]).unwrap();
    assert_eq!(fixture.write(RPDO1.mapping(1), &DUMMY_16.to_le_bytes()), Ok(()));
}

#[test]
fn invalid_mappings_are_refused() {
    let refused =
        |place, entries: &[u32]| Fixture::new().map(place, entries, EVERY_SYNC).unwrap_err();
    assert_eq!(refused(RPDO1, &[0x6064_0020]), AbortCode::NOT_MAPPABLE, "read only");
    assert_eq!(refused(RPDO1, &[0x6071_0020]), AbortCode::NOT_MAPPABLE, "another length");
    assert_eq!(refused(TPDO1, &[DUMMY_16]), AbortCode::NOT_MAPPABLE, "dummies are received");
    assert_eq!(refused(TPDO1, &[0x1018_0120]), AbortCode::NOT_MAPPABLE);
    assert_eq!(refused(TPDO1, &[0x5FFF_0020]), AbortCode::NO_OBJECT);
    assert_eq!(refused(TPDO1, &[POSITION; 3]), AbortCode::PDO_TOO_LONG);
    assert_eq!(
        refused(RPDO1, &[0]),
        AbortCode::NO_OBJECT,
        "an entry that is counted names something"
    );
}

#[test]
fn cob_id_of_another_service_is_refused() {
    let mut fixture = Fixture::new();
    fixture.write(RPDO1.communication(1), &(OFF | 0x205).to_le_bytes()).unwrap();
    for raw in [0, 0x80, 0x17F, 0x581, 0x605, 0x705, 0x2000_0205_u32] {
        let write = fixture.write(RPDO1.communication(1), &raw.to_le_bytes());
        assert_eq!(write, Err(AbortCode::VALUE_INVALID), "{raw:X}h");
    }
    assert_eq!(fixture.write(RPDO1.communication(2), &[241]), Err(AbortCode::VALUE_INVALID));
}

#[test]
fn tpdo_of_type_n_is_sent_at_every_nth_sync() {
    for n in [1, 2, 3, 7] {
        let mut fixture = Fixture::silent();
        fixture.map(TPDO1, &[POSITION], n).unwrap();
        fixture.order(NmtCommand::StartRemoteNode);
        let sent: Vec<_> = (0..21).map(|_| fixture.sync().len()).collect();
        let period = usize::from(n);
        assert_eq!(sent.iter().sum::<usize>(), 21 / period);
        assert!(sent.chunks_exact(period).all(|syncs| *syncs.last().unwrap() == 1), "{sent:?}");
    }
}

#[test]
fn late_tpdo_carries_the_sample_of_its_sync() {
    let mut fixture = Fixture::silent();
    fixture.device.latency = Duration::from_micros(60);
    fixture.map(TPDO1, &[POSITION], EVERY_SYNC).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    let put = |position: i32| {
        move |_: &mut Recorder, dictionary: &mut Dictionary| {
            assert!(dictionary.set(Object::POSITION_ACTUAL, &position.to_le_bytes()));
        }
    };
    fixture.device.touch(put(11));
    assert_eq!(fixture.sync(), []);
    fixture.device.touch(put(12));
    assert_eq!(fixture.device.deadline(), Some(Instant::from_micros(60)));
    assert_eq!(fixture.wait_until(1), [Frame::new(TPDO, [11, 0, 0, 0])]);
}

#[test]
fn event_driven_tpdo_keeps_inhibit_time_and_event_timer() {
    let mut fixture = Fixture::silent();
    fixture.write(TPDO1.communication(1), &(OFF | 0x185).to_le_bytes()).unwrap();
    fixture.write(TPDO1.communication(3), &[100, 0]).unwrap();
    fixture.write(TPDO1.communication(5), &[50, 0]).unwrap();
    fixture.map(TPDO1, &[POSITION], AT_ONCE).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    let put = |fixture: &mut Fixture, position: u8| {
        fixture.device.touch(|_, dictionary| {
            assert!(dictionary.set(Object::POSITION_ACTUAL, &[position, 0, 0, 0]));
        });
    };
    assert_eq!(fixture.wait_until(4), [], "sent on entering operational");
    put(&mut fixture, 1);
    put(&mut fixture, 2);
    assert_eq!(fixture.wait_until(9), [], "inhibited for 10 ms");
    assert_eq!(fixture.wait_until(10), [Frame::new(TPDO, [2, 0, 0, 0])]);
    assert_eq!(fixture.wait_until(59), []);
    assert_eq!(fixture.wait_until(60), [Frame::new(TPDO, [2, 0, 0, 0])], "unchanged, but due");
    put(&mut fixture, 3);
    put(&mut fixture, 2);
    assert_eq!(fixture.wait_until(80), [], "nothing has changed in the end");
}
