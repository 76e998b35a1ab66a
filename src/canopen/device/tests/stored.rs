//! Stored parameters (1010h, 1011h, 1020h).

use super::*;

const STAMP: [u8; 4] = [1, 2, 3, 4];

/// Configured, stamped and stored.
fn saved() -> Desk {
    let mut desk = Desk::new();
    desk.write(Object::PRODUCER_HEARTBEAT, &[25, 0]).unwrap();
    desk.write(Object::MAX_TORQUE, &[100, 0]).unwrap();
    desk.write(Object::CONFIGURATION_DATE, &STAMP).unwrap();
    desk.write(Object::STORE_PARAMETERS, b"save").unwrap();
    desk
}

#[test]
fn stored_parameters_alone_survive_a_reset() {
    let mut desk = saved();
    desk.write(Object::MAX_TORQUE, &[200, 0]).unwrap();
    desk.write(Object::CONTROLWORD, &[6, 0]).unwrap();
    desk.order(NmtCommand::ResetNode);
    assert_eq!(desk.read(Object::PRODUCER_HEARTBEAT), Ok(vec![25, 0]));
    assert_eq!(desk.read(Object::MAX_TORQUE), Ok(vec![100, 0]));
    assert_eq!(desk.read(Object::CONFIGURATION_DATE), Ok(STAMP.to_vec()));
    assert_eq!(desk.read(Object::STORE_PARAMETERS), Ok(vec![1, 0, 0, 0]));
    assert_eq!(desk.read(Object::CONTROLWORD), Ok(vec![0, 0]));
}

#[test]
fn restored_defaults_act_after_the_reset() {
    let mut desk = saved();
    desk.write(Object::RESTORE_DEFAULTS, b"load").unwrap();
    assert_eq!(desk.read(Object::MAX_TORQUE), Ok(vec![100, 0]), "not before");
    desk.order(NmtCommand::ResetNode);
    assert_eq!(desk.read(Object::MAX_TORQUE), Ok(3_000_u16.to_le_bytes().to_vec()));
    assert_eq!(desk.read(Object::CONFIGURATION_DATE), Ok(vec![0; 4]));
}

#[test]
fn stamp_is_cleared_by_a_differing_parameter() {
    let mut desk = saved();
    desk.write(Object::MAX_TORQUE, &[100, 0]).unwrap();
    desk.write(Object::CONTROLWORD, &[6, 0]).unwrap();
    desk.write(Object::ERROR_HISTORY, &[0]).unwrap();
    assert_eq!(desk.read(Object::CONFIGURATION_DATE), Ok(STAMP.to_vec()));
    desk.write(Object::MAX_TORQUE, &[101, 0]).unwrap();
    assert_eq!(desk.read(Object::CONFIGURATION_DATE), Ok(vec![0; 4]));
}

#[test]
fn wrong_signature_neither_stores_nor_restores() {
    let mut desk = Desk::new();
    for object in [Object::STORE_PARAMETERS, Object::RESTORE_DEFAULTS] {
        assert_eq!(desk.write(object, b"evas"), Err(AbortCode::NOT_STORED));
        assert_eq!(desk.read(object), Ok(vec![1, 0, 0, 0]));
    }
}
