//! LSS (CiA 305) between master and simulated devices, on a bus with the wire's timing.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::time::Duration;

use crate::common::bench::Wire;
use crate::common::devices::Devices;
use crate::common::devices::desk;
use crate::common::devices::settle;
use crate::common::golden::compare;
use bus::Memory;
use canopen::NmtCommand;
use canopen::NodeId;
use canopen::frame::Frame;
use canopen::lss::Address;
use canopen::lss::BitRate;
use canopen::lss::codec::Mode;
use canopen::lss::codec::Request;
use canopen::lss::identify::Description;
use canopen::lss::identify::Identify;
use canopen::lss::job::Job;
use canopen::lss::job::LssError;
use canopen::lss::job::Report;
use canopen::lss::job::Selection;
use canopen::lss::job::Timeouts;
use canopen::lss::master::Master;
use canopen::nmt::Order;
use canopen::procedure::Procedure;
use frhc::cli::bench::Session;
use units::time::Instant;

const TIMEOUTS: Timeouts = Timeouts {
    reply: Duration::from_millis(50),
    store: Duration::from_secs(1),
    probe: Duration::from_millis(10),
};

type Desk = Session<Memory<Devices, Wire>>;

/// The address of the shipped drive with a serial number.
const fn drive(serial: u32) -> Address {
    Address { vendor: 0xF8C, product: 0x0402_0010, revision: 0x0001_0000, serial }
}

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn carry(desk: &mut Desk, job: Job) -> Result<Report, LssError> {
    let outcome = desk.run(|now, out| Master::start(job, TIMEOUTS, now, out)).unwrap();
    settle(desk);
    outcome
}

fn configure(selection: Selection, node: Option<NodeId>) -> Job {
    Job { inquire: true, node: Some(node), store: true, ..Job::new(selection) }
}

/// Devices of these serial numbers, whose node-ids have been taken away.
fn unconfigured(serials: &[u32]) -> (Desk, Wire) {
    let numbers: Vec<(u8, u32)> = (1..).zip(serials.iter().copied()).collect();
    let (mut desk, wire) = desk(Devices::of(&numbers));
    for (raw, serial) in numbers {
        let known = Some(Some(node(raw)));
        let report = carry(&mut desk, configure(Selection::Address(drive(serial)), None));
        assert_eq!(report.unwrap().node, known);
        let reset = Order::to(node(raw), NmtCommand::ResetCommunication);
        desk.say([reset.frame()]).unwrap();
    }
    settle(&mut desk);
    wire.clear();
    (desk, wire)
}

fn identify(desk: &mut Desk, description: Option<Description>) -> u32 {
    let window = Duration::from_millis(20);
    let asked = desk.run(|now, out| match description {
        Some(description) => Identify::remote(description, window, now, out),
        None => Identify::non_configured(window, now, out),
    });
    asked.unwrap()
}

/// The node-ids there are, in the order of the devices.
fn nodes(desk: &Desk) -> Vec<Option<u8>> {
    let devices = desk.bus().stations().0.iter();
    devices.map(|device| device.is_configured().then(|| device.node().raw())).collect()
}

#[test]
fn the_golden_fastscan_finds_one_device() {
    let (mut desk, wire) = unconfigured(&[0x0A]);
    let scan = Job { inquire: true, ..Job::new(Selection::Fastscan) };
    let report = carry(&mut desk, scan).unwrap();
    assert_eq!((report.address, report.node), (Some(drive(0x0A)), Some(None)));
    compare("lss_fastscan.log", &wire.transcript(usize::MAX));
}

#[test]
fn the_golden_configuration_gives_a_device_its_first_node_id() {
    let (mut desk, wire) = unconfigured(&[0x0A]);
    let job = Job {
        bit_rate: BitRate::of_kilobits(500),
        ..configure(Selection::Address(drive(0x0A)), Some(node(9)))
    };
    let report = carry(&mut desk, job).unwrap();
    assert!(report.is_booted);
    assert_eq!(desk.bus().stations().0[0].bit_rate(), BitRate::of_kilobits(500));
    compare("lss_configure.log", &wire.transcript(usize::MAX));
}

#[test]
fn a_bus_of_new_devices_is_numbered_without_knowing_any() {
    let serials = [77, 3, 0xFFFF_FFFF, 0];
    let (mut desk, wire) = unconfigured(&serials);
    assert_eq!(identify(&mut desk, None), 4);
    for raw in 11..=14 {
        let report = carry(&mut desk, configure(Selection::Fastscan, Some(node(raw)))).unwrap();
        assert!(report.is_booted, "node {raw}");
    }
    // The lowest serial number is found first.
    assert_eq!(nodes(&desk), [Some(13), Some(12), Some(14), Some(11)]);
    let nobody = carry(&mut desk, configure(Selection::Fastscan, Some(node(15))));
    assert_eq!(nobody, Err(LssError::NoneUnconfigured));
    assert_eq!(identify(&mut desk, None), 0);
    let boot_ups = (0x70B..=0x70E).map(|id| wire.since(Instant::ZERO, id).len());
    assert_eq!(boot_ups.collect::<Vec<_>>(), [1; 4]);
}

#[test]
fn whoever_fits_a_description_answers() {
    let (mut desk, _) = desk(Devices::of(&[(1, 7), (2, 8), (3, 9)]));
    let whom =
        |revision, serial| Description { vendor: 0xF8C, product: 0x0402_0010, revision, serial };
    let every_revision = [0, u32::MAX];
    assert_eq!(identify(&mut desk, Some(whom(every_revision, [8, 100]))), 2);
    assert_eq!(identify(&mut desk, Some(whom(every_revision, [10, 100]))), 0);
    assert_eq!(identify(&mut desk, Some(whom([0, 0xFFFF], [7, 9]))), 0);
}

#[test]
fn several_devices_get_no_node_id_at_once() {
    let (mut desk, wire) = desk(Devices::of(&[(1, 7), (2, 8)]));
    let refused = carry(&mut desk, configure(Selection::All, Some(node(9))));
    assert!(matches!(refused, Err(LssError::Several(_))), "{refused:?}");
    let said = wire.since(Instant::ZERO, 0x7E5);
    assert!(said.iter().all(|(_, frame)| frame.data()[0] != 0x11), "configured: {said:?}");
    assert_eq!(said.last().unwrap().1, Request::SwitchGlobal(Mode::Waiting).frame());
}

#[test]
fn a_device_between_two_bit_rates_is_released_all_the_same() {
    let (mut desk, _) = desk(Devices::of(&[(1, 7)]));
    let bit_rate = BitRate::of_kilobits(250);
    let job = Job {
        bit_rate,
        activate: Some(100),
        ..configure(Selection::Address(drive(7)), Some(node(9)))
    };
    let begun = desk.now();
    carry(&mut desk, job).unwrap();
    assert!(desk.now().since(begun) > Duration::from_millis(200));
    assert_eq!(desk.bus().stations().0[0].bit_rate(), bit_rate);
    let silent = carry(&mut desk, Job { inquire: true, ..Job::new(Selection::Selected) });
    assert!(matches!(silent, Err(LssError::Timeout(_))), "{silent:?}");
}

/// A job that is interrupted after some frames, wherever that is.
struct Interrupted<P>(P, u32);

impl<P: Procedure> Procedure for Interrupted<P> {
    type Outcome = ();

    fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) -> Option<()> {
        let is_done = self.0.on_frame(now, frame, out).is_some();
        self.1 = self.1.saturating_sub(1);
        if self.1 == 0 && !is_done {
            self.0.abandon(now, out);
        }
        (self.1 == 0 || is_done).then_some(())
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<()> {
        self.0.on_time(now, out).map(|_| ())
    }

    fn deadline(&self) -> Option<Instant> {
        self.0.deadline()
    }
}

#[test]
fn wherever_a_job_is_interrupted_no_device_is_left_in_configuration() {
    for frames in 1..=9 {
        let (mut desk, _) = desk(Devices::of(&[(1, 7)]));
        let job = configure(Selection::Address(drive(7)), Some(node(9)));
        desk.run(|now, out| Interrupted(Master::start(job, TIMEOUTS, now, out), frames)).unwrap();
        let silent = carry(&mut desk, Job { inquire: true, ..Job::new(Selection::Selected) });
        assert!(matches!(silent, Err(LssError::Timeout(_))), "after {frames} frames: {silent:?}");
    }
}
