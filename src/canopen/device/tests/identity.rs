//! What a device says of itself, and what follows its node-id.

use super::*;
use crate::lss::codec::Answer;
use crate::lss::codec::Mode;
use crate::lss::codec::Reply;
use crate::lss::codec::Request;
use crate::time_stamp::TimeOfDay;

const CLIENT_TO_SERVER: Object = Object { index: 0x1200, sub: 1 };
const SERVER_TO_CLIENT: Object = Object { index: 0x1200, sub: 2 };

impl Desk {
    /// LSS makes it another node, from its next reset of communication on, which is now.
    fn becomes(&mut self, node: u8) {
        self.say(Request::SwitchGlobal(Mode::Configuration).frame());
        let done = Reply::NodeIdConfigured(Answer::DONE).frame();
        assert_eq!(self.say(Request::ConfigureNodeId(node).frame()), [done]);
        self.say(Request::SwitchGlobal(Mode::Waiting).frame());
        self.order(NmtCommand::ResetCommunication);
        assert_eq!(self.device.node().raw(), node);
    }

    fn holds(&self, object: Object) -> u32 {
        self.device.dictionary().unsigned(object)
    }
}

#[test]
fn the_device_hands_out_its_very_eds() {
    let mut desk = Desk::new();
    let file = include_bytes!("../../../../eds/frhc_drive.eds");
    assert!(desk.read(Object::STORED_EDS).unwrap() == file, "byte by byte");
    assert_eq!(desk.read(Object::STORE_FORMAT), Ok(vec![0]), "not compressed");
    desk.order(NmtCommand::ResetNode);
    assert!(desk.read(Object::STORED_EDS).unwrap() == file);
}

#[test]
fn the_default_sdo_channel_follows_the_node_id() {
    let mut desk = Desk::new();
    assert_eq!(desk.read(CLIENT_TO_SERVER), Ok(0x605_u32.to_le_bytes().to_vec()));
    assert_eq!(desk.read(SERVER_TO_CLIENT), Ok(0x585_u32.to_le_bytes().to_vec()));
    desk.becomes(9);
    assert_eq!((desk.holds(CLIENT_TO_SERVER), desk.holds(SERVER_TO_CLIENT)), (0x609, 0x589));
}

#[test]
fn an_identifier_that_was_kept_does_not_follow_the_node_id() {
    let mut desk = Desk::new();
    desk.write(RPDO1.communication(1), &(OFF | 0x333).to_le_bytes()).unwrap();
    desk.write(Object::STORE_PARAMETERS, b"save").unwrap();
    desk.becomes(9);
    assert_eq!(desk.holds(RPDO1.communication(1)), OFF | 0x333);
    assert_eq!(desk.holds(TPDO1.communication(1)), 0x189, "a default does");
}

#[test]
fn a_device_that_is_told_the_time_knows_it() {
    let noon = TimeOfDay { days: 15_665, millis: 43_200_000 };
    let [a, b, c, d, e, f] = noon.bytes();
    let mut desk = Desk::new();
    assert_eq!(desk.device.since_1970(desk.now), None);
    desk.say(Frame::new(0x100, [a, b, c, d, e]));
    assert_eq!(desk.device.since_1970(desk.now), None, "five bytes are no time");
    desk.say(Frame::new(0x100, [a, b, c, d, e, f]));
    desk.wait_until(250);
    let then = noon.since_1970() + Duration::from_millis(250);
    assert_eq!(desk.device.since_1970(desk.now), Some(then));
    desk.write(Object::TIME_COB_ID, &0x100_u32.to_le_bytes()).unwrap();
    desk.say(Frame::new(0x100, [0; 6]));
    assert_eq!(desk.device.since_1970(desk.now), Some(then), "it does not listen any more");
}
