//! LSS fastscan (CiA 305): finds the identity of one unconfigured slave, bit by bit.
//!
//! All unconfigured slaves compare a number in its high bits; no reply means that the next bit is one. Slaves with a one drop
//! out if others have a zero, so the lowest identity is found. That slave alone enters configuration, after 4 × (32 + 1) + 1
//! requests.
//!
//! A late reply must not count for the next request, so every request waits for its full window.

use std::time::Duration;

use canopen::frame::Frame;
use canopen_device::lss::codec::{Probe, Reply, Request};
use canopen_device::lss::{Address, Part};
use units::time::Instant;

/// Result of a fastscan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FastscanOutcome {
    /// No unconfigured slave replied.
    None,
    /// Identity of the slave, which is in configuration now.
    One(Address),
    /// Number that no slave confirmed as a whole: replies came too late, or a slave was removed.
    Lost(Part),
}

/// Fastscan in progress.
#[derive(Clone, Copy, Debug)]
pub struct Fastscan {
    window: Duration,
    address: Address,
    stage: Stage,
    is_answered: bool,
    /// End of the current request's window; `None` after the result.
    deadline: Option<Instant>,
}

/// Current request.
#[derive(Clone, Copy, Debug)]
enum Stage {
    Everybody,
    Bit(Part, u8),
    Whole(Part),
}

/// Highest bit of a number.
const HIGHEST_BIT: u8 = 31;

impl Fastscan {
    /// Starts a fastscan with a request to every unconfigured slave; each request has a reply window.
    pub fn start(window: Duration, now: Instant, out: &mut Vec<Frame>) -> Self {
        let mut scan = Self {
            window,
            address: Address::default(),
            stage: Stage::Everybody,
            is_answered: false,
            deadline: None,
        };
        scan.request(Stage::Everybody, now, out);
        scan
    }

    /// Takes one frame.
    pub fn on_frame(&mut self, frame: &Frame) {
        self.is_answered |= Reply::decode(frame) == Some(Reply::Identified);
    }

    /// Sends the next request at the end of a window. Returns the result once.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<FastscanOutcome> {
        if self.deadline.is_none_or(|deadline| now < deadline) {
            return None;
        }
        let next = match self.stage {
            Stage::Everybody if !self.is_answered => return self.finish(FastscanOutcome::None),
            Stage::Everybody => Stage::Bit(Part::Vendor, HIGHEST_BIT),
            Stage::Bit(part, bit) => {
                if !self.is_answered {
                    let known = self.address.part(part);
                    self.address = self.address.with(part, known | 1 << bit);
                }
                bit.checked_sub(1).map_or(Stage::Whole(part), |bit| Stage::Bit(part, bit))
            }
            Stage::Whole(part) if !self.is_answered => {
                return self.finish(FastscanOutcome::Lost(part));
            }
            Stage::Whole(part) => match Part::at(part.place() + 1) {
                Some(part) => Stage::Bit(part, HIGHEST_BIT),
                None => return self.finish(FastscanOutcome::One(self.address)),
            },
        };
        self.request(next, now, out);
        None
    }

    /// End of the current window.
    pub const fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    fn request(&mut self, stage: Stage, now: Instant, out: &mut Vec<Frame>) {
        let number = |part| self.address.part(part);
        let probe = match stage {
            Stage::Everybody => Probe { number: 0, bit: Probe::EVERYBODY, part: 0, next: 0 },
            Stage::Bit(part, bit) => {
                Probe { number: number(part), bit, part: part.place(), next: part.place() }
            }
            Stage::Whole(part) => {
                let next = Part::at(part.place() + 1).unwrap_or(Part::Vendor);
                Probe { number: number(part), bit: 0, part: part.place(), next: next.place() }
            }
        };
        out.push(Request::Fastscan(probe).frame());
        self.stage = stage;
        self.is_answered = false;
        self.deadline = Some(now + self.window);
    }

    const fn finish(&mut self, found: FastscanOutcome) -> Option<FastscanOutcome> {
        self.deadline = None;
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use canopen_rs::lss;
    use proptest::prelude::*;

    use super::*;
    use canopen_device::lss::REPLY_COB_ID;
    use canopen_device::lss::codec::LssState;
    use canopen_device::lss::slave::Slave;

    const WINDOW: Duration = Duration::from_millis(10);

    /// Runs a scan to its end; `answer` returns the number of replies to a request.
    fn scan(mut answer: impl FnMut(&Frame) -> usize) -> (FastscanOutcome, usize) {
        let (mut now, mut out, mut requests) = (Instant::ZERO, Vec::new(), 0);
        let mut scan = Fastscan::start(WINDOW, now, &mut out);
        loop {
            for request in out.drain(..) {
                requests += 1;
                for _ in 0..answer(&request) {
                    scan.on_frame(&Reply::Identified.frame());
                }
            }
            now = scan.deadline().unwrap();
            if let Some(found) = scan.on_time(now, &mut out) {
                assert_eq!((scan.deadline(), out.len()), (None, 0));
                return (found, requests);
            }
        }
    }

    fn answers(slaves: &mut [Slave], request: &Frame) -> usize {
        let mut out = Vec::new();
        for slave in slaves {
            slave.on_frame(request, &mut out);
        }
        out.len()
    }

    fn address() -> impl Strategy<Value = Address> {
        let number = || prop_oneof![any::<u32>(), Just(0), Just(u32::MAX), 0_u32..4];
        (number(), number(), number(), number()).prop_map(|(vendor, product, revision, serial)| {
            Address { vendor, product, revision, serial }
        })
    }

    fn theirs(address: Address) -> lss::LssAddress {
        lss::LssAddress {
            vendor_id: address.vendor,
            product_code: address.product,
            revision_number: address.revision,
            serial_number: address.serial,
        }
    }

    #[test]
    fn one_request_suffices_without_unconfigured_slaves() {
        assert_eq!(scan(|_| 0), (FastscanOutcome::None, 1));
    }

    #[test]
    fn slave_that_stops_replying_is_lost() {
        let mut received = 0;
        let falls_silent = |_: &Frame| {
            received += 1;
            usize::from(received <= 40)
        };
        assert_eq!(scan(falls_silent).0, FastscanOutcome::Lost(Part::Product));
    }

    #[test]
    fn only_identify_replies_count() {
        let mut out = Vec::new();
        let mut scan = Fastscan::start(WINDOW, Instant::ZERO, &mut out);
        for frame in [Reply::NonConfigured.frame(), Frame::new(REPLY_COB_ID, [0x4F])] {
            scan.on_frame(&frame);
        }
        assert_eq!(scan.on_time(Instant::ZERO + WINDOW, &mut out), Some(FastscanOutcome::None));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn slaves_are_found_one_after_another(
            mut addresses in proptest::collection::vec(address(), 1..5),
        ) {
            addresses.sort_by_key(|a| (a.vendor, a.product, a.revision, a.serial));
            addresses.dedup();
            let mut slaves: Vec<_> = addresses.iter().map(|a| Slave::new(*a, None)).collect();
            for (place, address) in addresses.iter().enumerate() {
                let (found, requests) = scan(|request| answers(&mut slaves, request));
                prop_assert_eq!(found, FastscanOutcome::One(*address));
                prop_assert_eq!(requests, 4 * 33 + 1);
                for (other, slave) in slaves.iter().enumerate() {
                    prop_assert_eq!(slave.state() == LssState::Configuration, other == place);
                }
                slaves[place].on_frame(&Request::ConfigureNodeId(9).frame(), &mut Vec::new());
                for slave in &mut slaves {
                    slave.on_frame(&Request::SwitchGlobal(LssState::Waiting).frame(), &mut Vec::new());
                }
            }
        }

        #[test]
        fn slave_of_canopen_rs_is_found(address in address()) {
            let mut slave = lss::LssSlave::new(theirs(address), lss::UNCONFIGURED_NODE_ID);
            let reply = |question: &Frame| {
                usize::from(slave.handle(&question.data().try_into().unwrap()).is_some())
            };
            prop_assert_eq!(scan(reply).0, FastscanOutcome::One(address));
            prop_assert_eq!(slave.state(), lss::LssState::Configuration);
        }

        // canopen-rs 0.6.1 starts with bit 32; CiA 305 defines 80h, and 32 is reserved.
        #[test]
        fn master_of_canopen_rs_finds_our_slave(address in address()) {
            let mut slave = Slave::new(address, None);
            let mut master = lss::FastscanMaster::new();
            while let Some(mut question) = master.next_request() {
                if question[5] == lss::FASTSCAN_INIT {
                    question[5] = Probe::EVERYBODY;
                }
                let frame = Frame::new(lss::LSS_MASTER_COB_ID, question);
                master.on_response(answers(std::slice::from_mut(&mut slave), &frame) == 1);
            }
            prop_assert!(master.found());
            prop_assert_eq!(master.address(), theirs(address));
            prop_assert_eq!(slave.state(), LssState::Configuration);
        }
    }
}
