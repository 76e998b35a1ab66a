//! LSS slave of a device (CiA 305), and its effect on the device.
//!
//! Without a node-id a device only takes LSS frames and sends no boot-up message. During a change of the bit
//! rate it does not communicate. A simulated bus has one bit rate, so a device always returns.

mod effects;

use std::time::Duration;

use canopen_rs::NodeId;

use crate::dictionary::Dictionary;
use crate::lss::slave::{Effect, Slave};
use crate::lss::{Address, BitRate, REQUEST_COB_ID};
use canopen::frame::Frame;
use canopen::object::Object;
use units::time::Instant;

/// Layer settings of one device.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    slave: Slave,
    /// End of the switch delay of a bit rate change.
    changing: Option<Instant>,
}

impl Layer {
    /// Returns the settings of a device delivered with a node-id, and the identity of its dictionary.
    pub(crate) fn new(node: NodeId, dictionary: &Dictionary) -> Self {
        let address = Address {
            vendor: dictionary.unsigned(Object::VENDOR_ID),
            product: dictionary.unsigned(Object::PRODUCT_CODE),
            revision: dictionary.unsigned(Object::REVISION),
            serial: dictionary.unsigned(Object::SERIAL),
        };
        Self { slave: Slave::new(address, Some(node)), changing: None }
    }

    /// Active node-id; `None` while unconfigured.
    pub(crate) const fn node(&self) -> Option<NodeId> {
        self.slave.node()
    }

    /// Configured bit rate; `None` before the first configuration.
    pub(crate) const fn bit_rate(&self) -> Option<BitRate> {
        self.slave.bit_rate()
    }

    /// Ends a bit rate change that is over.
    pub(crate) fn wake(&mut self, now: Instant) {
        self.changing.take_if(|until| *until <= now);
    }

    /// Returns the reason why the device does not communicate; `None` if it does.
    pub(crate) fn silence(&self) -> Option<Silence> {
        let unconfigured = self.node().is_none().then_some(Silence::Unconfigured);
        self.changing.map(Silence::Until).or(unconfigured)
    }

    /// Takes an LSS frame; returns true if the device must reset its communication.
    pub(crate) fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) -> bool {
        match self.slave.on_frame(frame, out) {
            Some(Effect::Reset) => true,
            Some(Effect::BitRate(delay)) => {
                self.changing = (delay > Duration::ZERO).then_some(now + delay * 2);
                false
            }
            None => false,
        }
    }

    /// Activates the pending node-id at a reset of communication.
    pub(crate) const fn reset(&mut self) {
        self.slave.reset();
    }

    /// Restores the stored settings at power-up.
    pub(crate) const fn power_cycle(&mut self) {
        self.slave.power_cycle();
        self.changing = None;
    }
}

/// Reason why a device does not communicate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Silence {
    /// Its bit rate is changing.
    Until(Instant),
    /// It has no node-id.
    Unconfigured,
}

impl Silence {
    /// Returns the end of the silence; `None` if only LSS ends it.
    pub(crate) const fn end(self) -> Option<Instant> {
        match self {
            Self::Until(end) => Some(end),
            Self::Unconfigured => None,
        }
    }
}

/// Returns whether a frame is an LSS request.
pub(crate) const fn is_request(frame: &Frame) -> bool {
    frame.cob_id == REQUEST_COB_ID
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lss::codec::{Answer, LssState, Reply, Request};
    use crate::{Application, Device};
    use canopen::eds::Eds;
    use canopen::nmt::Order;
    use canopen::{NmtCommand, NmtState};

    struct Idle;

    impl Application for Idle {}

    const CONFIGURE: Request = Request::SwitchGlobal(LssState::Configuration);
    const WAIT: Request = Request::SwitchGlobal(LssState::Waiting);
    const DONE: Reply = Reply::NodeIdConfigured(Answer::DONE);

    /// Device delivered as node 5, powered up at time zero.
    fn device() -> Device<Idle> {
        let eds = Eds::parse(include_bytes!("../../../../eds/frhc_drive.eds")).unwrap();
        let node = NodeId::new(5).unwrap();
        let mut device = Device::new(node, Dictionary::new(&eds, node), Idle, Duration::ZERO);
        assert_eq!(wait(&mut device, 0), [Frame::new(0x705, [0])]);
        device
    }

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn receive(device: &mut Device<Idle>, millis: u64, frame: &Frame) -> Vec<Frame> {
        let mut out = Vec::new();
        device.on_frame(at(millis), frame, &mut out);
        out
    }

    /// Returns the frames sent until `millis`, without received frames.
    fn wait(device: &mut Device<Idle>, millis: u64) -> Vec<Frame> {
        let mut out = Vec::new();
        while let Some(due) = device.deadline().filter(|due| *due <= at(millis)) {
            device.on_time(due, &mut out);
        }
        out
    }

    fn request(device: &mut Device<Idle>, request: Request) -> Vec<Frame> {
        receive(device, 0, &request.frame())
    }

    fn reset(device: &mut Device<Idle>, node: u8, command: NmtCommand) -> Vec<Frame> {
        receive(device, 0, &Order::to(NodeId::new(node).unwrap(), command).frame())
    }

    /// Configures a node-id, optionally stores it, and returns to the waiting state.
    fn assign(device: &mut Device<Idle>, node: u8, store: bool) -> Vec<Frame> {
        request(device, CONFIGURE);
        assert_eq!(request(device, Request::ConfigureNodeId(node)), [DONE.frame()]);
        if store {
            request(device, Request::Store);
        }
        request(device, WAIT)
    }

    #[test]
    fn new_node_id_acts_after_a_reset_of_communication() {
        for command in [NmtCommand::ResetCommunication, NmtCommand::ResetNode] {
            let mut device = device();
            assert_eq!(assign(&mut device, 9, false), []);
            assert_eq!(device.node().raw(), 5);
            assert_eq!(reset(&mut device, 5, command), [Frame::new(0x709, [0])]);
            assert_eq!(device.dictionary().unsigned(Object::EMCY_COB_ID), 0x89);
            let read = [0x40, 0x14, 0x10, 0, 0, 0, 0, 0];
            assert_eq!(receive(&mut device, 0, &Frame::new(0x605, read)), []);
            let reply = Frame::new(0x589, [0x43, 0x14, 0x10, 0, 0x89, 0, 0, 0]);
            assert_eq!(receive(&mut device, 0, &Frame::new(0x609, read)), [reply]);
        }
    }

    #[test]
    fn unstored_node_id_is_lost_with_power() {
        for (store, node) in [(false, 5), (true, 9)] {
            let mut device = device();
            assign(&mut device, 9, store);
            device.power_cycle();
            assert_eq!(wait(&mut device, 0), [Frame::new(0x700 + node, [0])]);
            assert_eq!(u16::from(device.node().raw()), node);
        }
    }

    #[test]
    fn device_without_node_id_takes_lss_only() {
        let mut device = device();
        // A heartbeat every 25 ms, which must stop.
        receive(&mut device, 0, &Frame::new(0x605, [0x2B, 0x17, 0x10, 0, 25, 0, 0, 0]));
        assign(&mut device, 255, false);
        assert_eq!(reset(&mut device, 5, NmtCommand::ResetCommunication), []);
        assert!(!device.is_configured());
        assert_eq!((device.deadline(), device.state()), (None, NmtState::Initialising));
        let mut out = Vec::new();
        device.on_time(at(1_000), &mut out);
        assert_eq!(out, []);
        let read = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
        for frame in [Frame::new(0x605, read), Frame::new(0x6FF, read), Frame::new(0, [1, 0])] {
            assert_eq!(receive(&mut device, 1_000, &frame), []);
        }
        assert_eq!(
            request(&mut device, Request::IdentifyNonConfigured),
            [Reply::NonConfigured.frame()]
        );
        assert_eq!(assign(&mut device, 9, false), [Frame::new(0x709, [0])], "it boots up");
        assert_eq!(device.state(), NmtState::PreOperational);
    }

    #[test]
    fn lss_is_taken_in_every_state() {
        for command in [NmtCommand::StartRemoteNode, NmtCommand::StopRemoteNode] {
            let mut device = device();
            reset(&mut device, 5, command);
            request(&mut device, CONFIGURE);
            let number = Reply::NodeId(5).frame();
            assert_eq!(request(&mut device, Request::InquireNodeId), [number]);
        }
    }

    #[test]
    fn device_changing_its_bit_rate_does_not_communicate() {
        let mut device = device();
        receive(&mut device, 0, &Frame::new(0x605, [0x2B, 0x17, 0x10, 0, 25, 0, 0, 0]));
        request(&mut device, CONFIGURE);
        assert_eq!(request(&mut device, Request::ActivateBitTiming(50)), []);
        assert_eq!(wait(&mut device, 0), [], "no bit rate was configured, none is activated");
        request(&mut device, Request::ConfigureBitTiming { table: 0, index: 2 });
        assert_eq!(device.bit_rate(), BitRate::of_kilobits(500));
        request(&mut device, Request::ActivateBitTiming(50));
        assert_eq!(device.deadline(), Some(at(100)));
        assert_eq!(receive(&mut device, 99, &Request::InquireNodeId.frame()), []);
        assert_eq!(wait(&mut device, 99), []);
        assert_eq!(wait(&mut device, 100), [Frame::new(0x705, [0x7F])], "its heartbeat again");
        assert_eq!(receive(&mut device, 100, &Request::InquireNodeId.frame()).len(), 1);
    }

    proptest! {
        #[test]
        fn any_lss_frames_never_panic_and_leave_nothing_due(
            steps in proptest::collection::vec(
                (0_u64..30_000, 0_u8..0x60, any::<[u8; 7]>(), prop::sample::select(vec![0_u16, 0x605, 0x7E5, 0x7E5, 0x7E5])),
                0..100,
            ),
        ) {
            let mut device = device();
            let mut now = Instant::ZERO;
            for (step, command, [a, b, c, d, e, f, g], cob_id) in steps {
                now = now + Duration::from_micros(step);
                let frame = match cob_id {
                    0 => Frame::new(0, [0x80 | a & 3, 0]),
                    cob_id => Frame::new(cob_id, [command, a & 0x81, b, c, d, e, f, g]),
                };
                let mut out = Vec::new();
                device.on_time(now, &mut out);
                device.on_frame(now, &frame, &mut out);
                device.on_time(now, &mut out);
                prop_assert!(out.len() <= 16, "{out:?}");
                prop_assert!(device.deadline().is_none_or(|due| due > now));
            }
        }
    }
}
