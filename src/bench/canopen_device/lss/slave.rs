//! LSS slave (CiA 305): state, replies, and three node-ids.
//!
//! The *pending* node-id is the configured one; it becomes *active* at the next reset of communication; the
//! *stored* one is active after power-up. A change is reported as an [`Effect`], which the
//! [device](crate::Device) applies.

use std::time::Duration;

use canopen_rs::NodeId;

use crate::lss::codec::{Answer, Condition, LssState, Probe, Reply, Request};
use crate::lss::{Address, BitRate, Part, STANDARD_TABLE, node_byte, node_of};
use canopen::frame::Frame;

/// Effect of a request on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Reset of communication with boot-up: the device left configuration with its first node-id.
    Reset,
    /// Switch to the configured bit rate after this time without frames. The device resumes after the same time again.
    BitRate(Duration),
}

/// LSS slave (CiA 305) with its active, pending and stored settings.
#[derive(Clone, Debug)]
pub struct Slave {
    address: Address,
    state: LssState,
    active: Option<NodeId>,
    pending: Option<NodeId>,
    stored: Option<NodeId>,
    bit_rate: Option<BitRate>,
    stored_bit_rate: Option<BitRate>,
    /// Number of consecutive matching parts of a selection.
    selected: usize,
    /// Number of consecutive met conditions of an identification.
    identified: usize,
    /// Part compared by the fastscan.
    scanned: Part,
}

impl Slave {
    /// Returns a slave after power-up with its stored node-id, if any.
    pub const fn new(address: Address, stored: Option<NodeId>) -> Self {
        Self {
            address,
            state: LssState::Waiting,
            active: stored,
            pending: stored,
            stored,
            bit_rate: None,
            stored_bit_rate: None,
            selected: 0,
            identified: 0,
            scanned: Part::Vendor,
        }
    }

    /// LSS state: waiting or configuration.
    pub const fn state(&self) -> LssState {
        self.state
    }

    /// Active node-id; `None` while unconfigured.
    pub const fn node(&self) -> Option<NodeId> {
        self.active
    }

    /// Configured bit rate; `None` before the first configuration.
    pub const fn bit_rate(&self) -> Option<BitRate> {
        self.bit_rate
    }

    /// Activates the pending node-id at a reset of communication.
    pub const fn reset(&mut self) {
        *self = Self {
            bit_rate: self.bit_rate,
            stored: self.stored,
            stored_bit_rate: self.stored_bit_rate,
            ..Self::new(self.address, self.pending)
        };
    }

    /// Restores the stored node-id and bit rate at power-up.
    pub const fn power_cycle(&mut self) {
        *self = Self {
            bit_rate: self.stored_bit_rate,
            stored_bit_rate: self.stored_bit_rate,
            ..Self::new(self.address, self.stored)
        };
    }

    /// Takes one received frame; a reply is appended to `out`.
    pub fn on_frame(&mut self, frame: &Frame, out: &mut Vec<Frame>) -> Option<Effect> {
        let request = Request::decode(frame)?;
        let (reply, effect) = match request {
            Request::SwitchGlobal(state) => (None, self.switch(state)),
            Request::IdentifyRemote(condition, number) => (self.identify(condition, number), None),
            Request::IdentifyNonConfigured => {
                (self.is_unconfigured().then_some(Reply::NonConfigured), None)
            }
            Request::Select(..) | Request::Fastscan(_) if self.state == LssState::Configuration => {
                (None, None)
            }
            Request::Select(part, number) => (self.select(part, number), None),
            Request::Fastscan(probe) => (self.scan(probe), None),
            _ if self.state == LssState::Waiting => (None, None),
            Request::ActivateBitTiming(delay) => (None, self.activate(delay)),
            Request::ConfigureNodeId(node) => (Some(self.configure_node(node)), None),
            Request::ConfigureBitTiming { table, index } => {
                (Some(self.configure_bit_rate(table, index)), None)
            }
            Request::Store => (Some(self.store()), None),
            Request::Inquire(part) => (Some(Reply::Inquired(part, self.address.part(part))), None),
            Request::InquireNodeId => (Some(Reply::NodeId(node_byte(self.active))), None),
        };
        out.extend(reply.map(Reply::frame));
        effect
    }

    /// Returns whether the slave has no active and no pending node-id.
    const fn is_unconfigured(&self) -> bool {
        self.active.is_none() && self.pending.is_none()
    }

    fn switch(&mut self, state: LssState) -> Option<Effect> {
        let is_left = self.state == LssState::Configuration && state == LssState::Waiting;
        self.state = state;
        self.selected = 0;
        let gets_its_first = self.active.is_none() && self.pending.is_some();
        (is_left && gets_its_first).then_some(Effect::Reset)
    }

    /// Compares a part; the fourth consecutive match selects the slave.
    fn select(&mut self, part: Part, number: u32) -> Option<Reply> {
        let is_mine = number == self.address.part(part);
        self.selected = progress(self.selected, usize::from(part.place()), is_mine);
        if self.selected < Part::ALL.len() {
            return None;
        }
        self.selected = 0;
        self.state = LssState::Configuration;
        Some(Reply::Selected)
    }

    /// Checks a condition; the sixth consecutive one identifies the slave.
    fn identify(&mut self, condition: Condition, number: u32) -> Option<Reply> {
        let Address { vendor, product, revision, serial } = self.address;
        let is_met = match condition {
            Condition::Vendor => vendor == number,
            Condition::Product => product == number,
            Condition::LowestRevision => revision >= number,
            Condition::HighestRevision => revision <= number,
            Condition::LowestSerial => serial >= number,
            Condition::HighestSerial => serial <= number,
        };
        let place = Condition::ALL.iter().position(|one| *one == condition).unwrap_or(0);
        self.identified = progress(self.identified, place, is_met);
        if self.identified < Condition::ALL.len() {
            return None;
        }
        self.identified = 0;
        Some(Reply::Identified)
    }

    /// Replies while the compared bits match; enters configuration after the last part matches in all bits.
    fn scan(&mut self, probe: Probe) -> Option<Reply> {
        if !self.is_unconfigured() {
            return None;
        }
        if probe.bit == Probe::EVERYBODY {
            self.scanned = Part::Vendor;
            return Some(Reply::Identified);
        }
        let mask = u32::MAX.checked_shl(u32::from(probe.bit))?;
        let own = self.address.part(self.scanned);
        let next = Part::at(probe.next)?;
        if probe.part != self.scanned.place() || (probe.number ^ own) & mask != 0 {
            return None;
        }
        if probe.bit == 0 {
            if next < self.scanned {
                self.state = LssState::Configuration;
            }
            self.scanned = next;
        }
        Some(Reply::Identified)
    }

    fn configure_node(&mut self, byte: u8) -> Reply {
        let node = node_of(byte);
        if let Ok(node) = node {
            self.pending = node;
        }
        Reply::NodeIdConfigured(if node.is_ok() { Answer::DONE } else { Answer::REFUSED })
    }

    fn configure_bit_rate(&mut self, table: u8, index: u8) -> Reply {
        let known = BitRate::of_index(index).filter(|_| table == STANDARD_TABLE);
        self.bit_rate = known.or(self.bit_rate);
        let answer = if known.is_some() { Answer::DONE } else { Answer::REFUSED };
        Reply::BitTimingConfigured(answer)
    }

    fn activate(&self, delay: u16) -> Option<Effect> {
        self.bit_rate.map(|_| Effect::BitRate(Duration::from_millis(u64::from(delay))))
    }

    const fn store(&mut self) -> Reply {
        self.stored = self.pending;
        self.stored_bit_rate = self.bit_rate;
        Reply::Stored(Answer::DONE)
    }
}

/// Returns the number of consecutive matches after the element at `place`.
const fn progress(before: usize, place: usize, fits: bool) -> usize {
    let is_next = place == 0 || place == before;
    if is_next && fits { place + 1 } else { 0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ADDRESS: Address =
        Address { vendor: 0xF8C, product: 0x0402_0010, revision: 0x0001_0000, serial: 7 };

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    fn request(slave: &mut Slave, request: Request) -> (Option<Reply>, Option<Effect>) {
        let mut out = Vec::new();
        let effect = slave.on_frame(&request.frame(), &mut out);
        assert!(out.len() <= 1);
        (out.first().map(|frame| Reply::decode(frame).unwrap()), effect)
    }

    fn answer(slave: &mut Slave, request: Request) -> Option<Reply> {
        self::request(slave, request).0
    }

    fn select(slave: &mut Slave, address: Address) -> Vec<Reply> {
        let requests = Part::ALL.map(|part| Request::Select(part, address.part(part)));
        requests.into_iter().filter_map(|request| answer(slave, request)).collect()
    }

    fn configuring(stored: Option<NodeId>) -> Slave {
        let mut slave = Slave::new(ADDRESS, stored);
        assert_eq!(select(&mut slave, ADDRESS), [Reply::Selected]);
        slave
    }

    const TO_WAITING: Request = Request::SwitchGlobal(LssState::Waiting);

    #[test]
    fn only_its_own_address_selects_a_slave() {
        for part in Part::ALL {
            let mut slave = Slave::new(ADDRESS, None);
            let other = ADDRESS.with(part, ADDRESS.part(part) ^ 1);
            assert_eq!(select(&mut slave, other), []);
            assert_eq!(slave.state(), LssState::Waiting);
        }
        assert_eq!(configuring(None).state(), LssState::Configuration);
    }

    #[test]
    fn address_out_of_order_selects_no_slave() {
        let mut slave = Slave::new(ADDRESS, None);
        for part in [Part::Vendor, Part::Revision, Part::Product, Part::Revision, Part::Serial] {
            assert_eq!(answer(&mut slave, Request::Select(part, ADDRESS.part(part))), None);
        }
    }

    #[test]
    fn waiting_slave_is_neither_inquired_nor_configured() {
        let mut slave = Slave::new(ADDRESS, Some(node(5)));
        let inquiries = Part::ALL.map(Request::Inquire);
        let settings = [
            Request::InquireNodeId,
            Request::ConfigureNodeId(9),
            Request::ConfigureBitTiming { table: 0, index: 0 },
            Request::ActivateBitTiming(10),
            Request::Store,
        ];
        for request in inquiries.into_iter().chain(settings) {
            assert_eq!(self::request(&mut slave, request), (None, None), "{request}");
        }
        slave.reset();
        assert_eq!(slave.node(), Some(node(5)));
    }

    #[test]
    fn slave_in_configuration_reports_its_identity() {
        let mut slave = configuring(Some(node(5)));
        for part in Part::ALL {
            let reply = answer(&mut slave, Request::Inquire(part));
            assert_eq!(reply, Some(Reply::Inquired(part, ADDRESS.part(part))));
        }
        assert_eq!(answer(&mut slave, Request::InquireNodeId), Some(Reply::NodeId(5)));
    }

    #[test]
    fn node_id_acts_after_reset_and_is_lost_unless_stored() {
        for is_stored in [false, true] {
            let mut slave = configuring(Some(node(5)));
            let set = answer(&mut slave, Request::ConfigureNodeId(9));
            assert_eq!(set, Some(Reply::NodeIdConfigured(Answer::DONE)));
            if is_stored {
                let stored = answer(&mut slave, Request::Store);
                assert_eq!(stored, Some(Reply::Stored(Answer::DONE)));
            }
            assert_eq!(request(&mut slave, TO_WAITING), (None, None));
            assert_eq!(slave.node(), Some(node(5)));
            slave.reset();
            assert_eq!(slave.node(), Some(node(9)));
            slave.power_cycle();
            assert_eq!(slave.node(), Some(node(if is_stored { 9 } else { 5 })));
        }
    }

    #[test]
    fn first_node_id_acts_on_leaving_configuration() {
        let mut slave = configuring(None);
        assert_eq!(request(&mut slave, TO_WAITING), (None, None), "no node-id yet");
        select(&mut slave, ADDRESS);
        answer(&mut slave, Request::ConfigureNodeId(9));
        assert_eq!(request(&mut slave, TO_WAITING), (None, Some(Effect::Reset)));
        slave.reset();
        assert_eq!(slave.node(), Some(node(9)));
        assert_eq!(request(&mut slave, TO_WAITING), (None, None));
    }

    #[test]
    fn node_id_out_of_range_is_refused() {
        for byte in [0, 128, 0xFE] {
            let mut slave = configuring(Some(node(5)));
            let refused = answer(&mut slave, Request::ConfigureNodeId(byte));
            assert_eq!(refused, Some(Reply::NodeIdConfigured(Answer::REFUSED)));
            slave.reset();
            assert_eq!(slave.node(), Some(node(5)));
        }
    }

    #[test]
    fn bit_rates_are_those_of_the_standard_table() {
        for table in [0, 1, 0x80] {
            for index in 0..=255 {
                let mut slave = configuring(None);
                let reply = answer(&mut slave, Request::ConfigureBitTiming { table, index });
                let is_known = table == 0 && index <= 8 && index != 5;
                let expected = if is_known { Answer::DONE } else { Answer::REFUSED };
                assert_eq!(reply, Some(Reply::BitTimingConfigured(expected)), "{table} {index}");
                assert_eq!(slave.bit_rate().is_some(), is_known);
                let effect = request(&mut slave, Request::ActivateBitTiming(20));
                let silence = Effect::BitRate(Duration::from_millis(20));
                assert_eq!(effect, (None, is_known.then_some(silence)));
            }
        }
    }

    #[test]
    fn matching_slave_replies_in_either_state() {
        let fitting = [0xF8C, 0x0402_0010, 0x0001_0000, 0x0001_0000, 0, 7];
        let describe = |slave: &mut Slave, numbers: [u32; 6]| {
            let requests = Condition::ALL.into_iter().zip(numbers);
            let replies =
                requests.filter_map(|(c, n)| answer(slave, Request::IdentifyRemote(c, n)));
            replies.collect::<Vec<_>>()
        };
        for mut slave in [Slave::new(ADDRESS, Some(node(5))), configuring(None)] {
            assert_eq!(describe(&mut slave, fitting), [Reply::Identified]);
            for (place, wrong) in [(0, 1), (1, 1), (2, 0x0001_0001), (3, 0xFFFF), (4, 8), (5, 6)] {
                let mut numbers = fitting;
                numbers[place] = wrong;
                assert_eq!(describe(&mut slave, numbers), [], "{place}");
            }
        }
    }

    #[test]
    fn only_unconfigured_slaves_reply_non_configured() {
        let replies = [None, Some(node(5))]
            .map(|stored| answer(&mut Slave::new(ADDRESS, stored), Request::IdentifyNonConfigured));
        assert_eq!(replies, [Some(Reply::NonConfigured), None]);
        let mut slave = configuring(None);
        answer(&mut slave, Request::ConfigureNodeId(9));
        assert_eq!(
            answer(&mut slave, Request::IdentifyNonConfigured),
            None,
            "its node-id is pending"
        );
    }

    #[test]
    fn fastscan_concerns_unconfigured_waiting_slaves() {
        let request =
            Request::Fastscan(Probe { number: 0, bit: Probe::EVERYBODY, part: 0, next: 0 });
        assert_eq!(answer(&mut Slave::new(ADDRESS, Some(node(5))), request), None);
        assert_eq!(answer(&mut configuring(None), request), None);
        let mut slave = Slave::new(ADDRESS, None);
        assert_eq!(answer(&mut slave, request), Some(Reply::Identified));
        for (number, bit, part, fits) in [
            (0, 31, 0, true),
            (0xF80, 4, 0, true),
            (0xF80, 3, 0, false),
            (0xF8C, 0, 1, false),
            (0xF8C, 32, 0, false),
            (0xF8C, 0, 0, true),
        ] {
            let probe = Request::Fastscan(Probe { number, bit, part, next: part });
            assert_eq!(answer(&mut slave, probe).is_some(), fits, "{number:X}h {bit} {part}");
        }
    }

    proptest! {
        #[test]
        fn any_frames_get_one_reply_and_keep_a_valid_node_id(
            frames in proptest::collection::vec(
                (0x7E4_u16..0x7E7, 0_u8..0x60, any::<[u8; 7]>(), 1_usize..9), 0..100,
            ),
        ) {
            let mut slave = Slave::new(ADDRESS, None);
            for (cob_id, command, [a, b, c, d, e, f, g], length) in frames {
                let bytes = [command, a, b, c, d, e, f, g];
                let mut out = Vec::new();
                let frame = Frame::from_slice(cob_id, &bytes[..length]).unwrap();
                let effect = slave.on_frame(&frame, &mut out);
                prop_assert!(out.len() <= 1);
                if effect == Some(Effect::Reset) {
                    slave.reset();
                    prop_assert!(slave.node().is_some());
                }
            }
        }
    }
}
