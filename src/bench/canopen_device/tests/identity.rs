//! Identity of a device, and objects that follow its node-id.

use super::*;
use crate::lss::codec::{Answer, LssState, Reply, Request};
use canopen::time_stamp::TimeOfDay;

const CLIENT_TO_SERVER: Object = Object { index: 0x1200, sub: 1 };
const SERVER_TO_CLIENT: Object = Object { index: 0x1200, sub: 2 };

impl Fixture {
    /// Assigns another node-id by LSS and resets communication.
    fn becomes(&mut self, node: u8) {
        self.deliver(Request::SwitchGlobal(LssState::Configuration).frame());
        let done = Reply::NodeIdConfigured(Answer::DONE).frame();
        assert_eq!(self.deliver(Request::ConfigureNodeId(node).frame()), [done]);
        self.deliver(Request::SwitchGlobal(LssState::Waiting).frame());
        self.order(NmtCommand::ResetCommunication);
        assert_eq!(self.device.node().raw(), node);
    }

    fn holds(&self, object: Object) -> u32 {
        self.device.dictionary().unsigned(object)
    }
}

#[test]
fn stored_eds_is_the_file() {
    let mut fixture = Fixture::new();
    let file = include_bytes!("../../../../eds/frhc_drive.eds");
    assert!(fixture.read(Object::STORED_EDS).unwrap() == file, "byte by byte");
    assert_eq!(fixture.read(Object::STORE_FORMAT), Ok(vec![0]), "not compressed");
    fixture.order(NmtCommand::ResetNode);
    assert!(fixture.read(Object::STORED_EDS).unwrap() == file);
}

#[test]
fn default_sdo_channel_follows_the_node_id() {
    let mut fixture = Fixture::new();
    assert_eq!(fixture.read(CLIENT_TO_SERVER), Ok(0x605_u32.to_le_bytes().to_vec()));
    assert_eq!(fixture.read(SERVER_TO_CLIENT), Ok(0x585_u32.to_le_bytes().to_vec()));
    fixture.becomes(9);
    assert_eq!((fixture.holds(CLIENT_TO_SERVER), fixture.holds(SERVER_TO_CLIENT)), (0x609, 0x589));
}

#[test]
fn stored_cob_id_does_not_follow_the_node_id() {
    let mut fixture = Fixture::new();
    fixture.write(RPDO1.communication(1), &(OFF | 0x333).to_le_bytes()).unwrap();
    fixture.write(Object::STORE_PARAMETERS, b"save").unwrap();
    fixture.becomes(9);
    assert_eq!(fixture.holds(RPDO1.communication(1)), OFF | 0x333);
    assert_eq!(fixture.holds(TPDO1.communication(1)), 0x189, "a default does");
}

#[test]
fn time_message_sets_the_clock() {
    let noon = TimeOfDay { days: 15_665, millis: 43_200_000 };
    let [a, b, c, d, e, f] = noon.bytes();
    let mut fixture = Fixture::new();
    assert_eq!(fixture.device.since_1970(fixture.now), None);
    fixture.deliver(Frame::new(0x100, [a, b, c, d, e]));
    assert_eq!(fixture.device.since_1970(fixture.now), None, "five bytes are no time");
    fixture.deliver(Frame::new(0x100, [a, b, c, d, e, f]));
    fixture.wait_until(250);
    let then = noon.since_1970() + Duration::from_millis(250);
    assert_eq!(fixture.device.since_1970(fixture.now), Some(then));
    fixture.write(Object::TIME_COB_ID, &0x100_u32.to_le_bytes()).unwrap();
    fixture.deliver(Frame::new(0x100, [0; 6]));
    assert_eq!(fixture.device.since_1970(fixture.now), Some(then), "TIME is no longer consumed");
}
