//! Stored parameters (1010h, 1011h, 1020h).

use super::*;

const STAMP: [u8; 4] = [1, 2, 3, 4];

/// Configured, stamped and stored.
fn saved() -> Fixture {
    let mut fixture = Fixture::new();
    fixture.write(Object::PRODUCER_HEARTBEAT, &[25, 0]).unwrap();
    fixture.write(Object::MAX_TORQUE, &[100, 0]).unwrap();
    fixture.write(Object::CONFIGURATION_DATE, &STAMP).unwrap();
    fixture.write(Object::STORE_PARAMETERS, b"save").unwrap();
    fixture
}

#[test]
fn stored_parameters_alone_survive_a_reset() {
    let mut fixture = saved();
    fixture.write(Object::MAX_TORQUE, &[200, 0]).unwrap();
    fixture.write(Object::CONTROLWORD, &[6, 0]).unwrap();
    fixture.order(NmtCommand::ResetNode);
    assert_eq!(fixture.read(Object::PRODUCER_HEARTBEAT), Ok(vec![25, 0]));
    assert_eq!(fixture.read(Object::MAX_TORQUE), Ok(vec![100, 0]));
    assert_eq!(fixture.read(Object::CONFIGURATION_DATE), Ok(STAMP.to_vec()));
    assert_eq!(fixture.read(Object::STORE_PARAMETERS), Ok(vec![1, 0, 0, 0]));
    assert_eq!(fixture.read(Object::CONTROLWORD), Ok(vec![0, 0]));
}

#[test]
fn restored_defaults_act_after_the_reset() {
    let mut fixture = saved();
    fixture.write(Object::RESTORE_DEFAULTS, b"load").unwrap();
    assert_eq!(fixture.read(Object::MAX_TORQUE), Ok(vec![100, 0]), "not before");
    fixture.order(NmtCommand::ResetNode);
    assert_eq!(fixture.read(Object::MAX_TORQUE), Ok(3_000_u16.to_le_bytes().to_vec()));
    assert_eq!(fixture.read(Object::CONFIGURATION_DATE), Ok(vec![0; 4]));
}

#[test]
fn stamp_is_cleared_by_a_differing_parameter() {
    let mut fixture = saved();
    fixture.write(Object::MAX_TORQUE, &[100, 0]).unwrap();
    fixture.write(Object::CONTROLWORD, &[6, 0]).unwrap();
    fixture.write(Object::ERROR_HISTORY, &[0]).unwrap();
    assert_eq!(fixture.read(Object::CONFIGURATION_DATE), Ok(STAMP.to_vec()));
    fixture.write(Object::MAX_TORQUE, &[101, 0]).unwrap();
    assert_eq!(fixture.read(Object::CONFIGURATION_DATE), Ok(vec![0; 4]));
}

#[test]
fn wrong_signature_neither_stores_nor_restores() {
    let mut fixture = Fixture::new();
    for object in [Object::STORE_PARAMETERS, Object::RESTORE_DEFAULTS] {
        assert_eq!(fixture.write(object, b"evas"), Err(AbortCode::NOT_STORED));
        assert_eq!(fixture.read(object), Ok(vec![1, 0, 0, 0]));
    }
}
