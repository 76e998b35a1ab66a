//! Error control: lost masters and the reaction (CiA 301, 7.2.8).

use super::*;

#[test]
fn rpdo_timeout_is_reported_once_after_the_first_frame() {
    let mut fixture = Fixture::with_target(EVERY_SYNC);
    fixture.write(RPDO1.communication(5), &[5, 0]).unwrap();
    assert_eq!(fixture.wait_until(100), [], "none has come yet");
    fixture.deliver(Frame::new(RPDO, [1, 0]));
    assert_eq!(fixture.wait_until(104), []);
    assert_eq!(fixture.wait_until(105), [emergency(0x8250, 0x11, [1, 2, 3, 4, 5])]);
    assert_eq!(fixture.device.application().lost, [ConnectionLoss::RpdoTimeout]);
    assert_eq!(fixture.wait_until(1_000), []);
    assert_eq!(fixture.deliver(Frame::new(RPDO, [1, 0])), [emergency(0, 0, [0; 5])]);
    fixture.order(NmtCommand::EnterPreOperational);
    assert_eq!(fixture.wait_until(2_000), [], "the event timer runs in operational only");
}

#[test]
fn lost_master_is_reported_and_operational_is_left() {
    for (behaviour, state) in
        [(0, NmtState::PreOperational), (1, NmtState::Operational), (2, NmtState::Stopped)]
    {
        let mut fixture = Fixture::new();
        fixture.write(Object::CONSUMER_HEARTBEAT, &MASTER_FOR_20_MS.to_le_bytes()).unwrap();
        fixture.write(Object::ERROR_BEHAVIOUR, &[behaviour]).unwrap();
        fixture.order(NmtCommand::StartRemoteNode);
        fixture.wait_until(500);
        assert_eq!(fixture.device.application().lost, [], "no heartbeat received yet");
        fixture.deliver(Frame::new(0x77F, [5]));
        fixture.wait_until(519);
        assert_eq!(fixture.device.application().lost, []);
        let sent = fixture.wait_until(520);
        assert!(sent.contains(&emergency(0x8130, 0x11, [1, 2, 3, 4, 5])), "{sent:?}");
        assert_eq!(fixture.device.state(), state);
        assert_eq!(fixture.device.application().lost, [ConnectionLoss::Heartbeat]);
    }
}

#[test]
fn guarded_device_answers_with_state_and_toggle_bit() {
    let mut fixture = Fixture::new();
    let question = Frame::remote(0x705, 1);
    let answer = |byte| [Frame::new(0x705, [byte])];
    assert_eq!(fixture.deliver(question), answer(0x7F));
    fixture.order(NmtCommand::StartRemoteNode);
    assert_eq!(fixture.deliver(question), answer(0x85));
    assert_eq!(fixture.deliver(question), answer(0x05));
    assert_eq!(fixture.deliver(Frame::remote(0x706, 1)), [], "another node is polled");
    assert_eq!(fixture.deliver(Frame::remote(0x80, 0)), [], "no SYNC");
    assert_eq!(fixture.order(NmtCommand::ResetCommunication), answer(0), "boot-up");
    assert_eq!(fixture.deliver(question), answer(0x7F), "the toggle bit restarts");
    fixture.write(Object::PRODUCER_HEARTBEAT, &[25, 0]).unwrap();
    assert_eq!(fixture.deliver(question), [], "a heartbeat takes the place of guarding");
}

#[test]
fn lost_guard_is_reported_once_and_operational_is_left() {
    let mut fixture = Fixture::silent();
    fixture.write(Object::GUARD_TIME, &[20, 0]).unwrap();
    fixture.write(Object::LIFE_TIME_FACTOR, &[3]).unwrap();
    fixture.order(NmtCommand::StartRemoteNode);
    assert_eq!(fixture.wait_until(500), [], "no poll received yet");
    fixture.deliver(Frame::remote(0x705, 1));
    assert_eq!(fixture.wait_until(559), []);
    assert_eq!(fixture.wait_until(560), [emergency(0x8130, 0x11, [1, 2, 3, 4, 5])]);
    assert_eq!(fixture.device.state(), NmtState::PreOperational);
    assert_eq!(fixture.device.application().lost, [ConnectionLoss::Heartbeat]);
    assert_eq!(fixture.wait_until(5_000), []);
    let sent = fixture.deliver(Frame::remote(0x705, 1));
    assert_eq!(sent, [emergency(0, 0, [0; 5]), Frame::new(0x705, [0xFF])]);
}

#[test]
fn heartbeat_starts_when_configured_and_repeats() {
    let mut fixture = Fixture::new();
    let request = Frame::new(0x605, [0x2B, 0x17, 0x10, 0, 25, 0, 0, 0]);
    let beat = Frame::new(0x705, [0x7F]);
    assert_eq!(fixture.deliver(request).last(), Some(&beat));
    assert_eq!(fixture.wait_until(74), [beat; 2]);
    assert_eq!(fixture.wait_until(75), [beat]);
}
