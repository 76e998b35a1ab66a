//! LSS (CiA 305) between master and simulated devices, on a bus with bit timing.

use cli::live_bus::Session;

use crate::common::devices::{Devices, session, settle};
use crate::common::golden::compare;
use crate::common::prelude::*;
use canopen::NmtCommand;
use canopen::nmt::Order;
use canopen_device::lss::codec::{LssState, Request};
use canopen_device::lss::{Address, BitRate};
use canopen_tools::lss::identify::{Description, Identify};
use canopen_tools::lss::job::{Job, LssError, Report, Selection, Timeouts};
use canopen_tools::lss::master::Master;
use canopen_tools::procedure::Procedure;

const TIMEOUTS: Timeouts = Timeouts {
    reply: Duration::from_millis(50),
    store: Duration::from_secs(1),
    probe: Duration::from_millis(10),
};

type TestSession = Session<Memory<Devices, Wire>>;

/// LSS address of the shipped drive with a serial number.
const fn drive(serial: u32) -> Address {
    Address { vendor: 0xF8C, product: 0x0402_0010, revision: 0x0001_0000, serial }
}

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn carry(session: &mut TestSession, job: Job) -> Result<Report, LssError> {
    let outcome = session.run(|now, out| Master::start(job, TIMEOUTS, now, out)).unwrap();
    settle(session);
    outcome
}

fn configure(selection: Selection, node: Option<NodeId>) -> Job {
    Job { inquire: true, node: Some(node), store: true, ..Job::new(selection) }
}

/// Devices with these serial numbers, without node-ids.
fn unconfigured(serials: &[u32]) -> (TestSession, Wire) {
    let numbers: Vec<(u8, u32)> = (1..).zip(serials.iter().copied()).collect();
    let (mut session, wire) = session(Devices::from_numbers(&numbers));
    for (raw, serial) in numbers {
        let known = Some(Some(node(raw)));
        let report = carry(&mut session, configure(Selection::Address(drive(serial)), None));
        assert_eq!(report.unwrap().node, known);
        let reset = Order::to(node(raw), NmtCommand::ResetCommunication);
        session.send([reset.frame()]).unwrap();
    }
    settle(&mut session);
    wire.clear();
    (session, wire)
}

fn identify(session: &mut TestSession, description: Option<Description>) -> u32 {
    let window = Duration::from_millis(20);
    let requests = session.run(|now, out| match description {
        Some(description) => Identify::remote(description, window, now, out),
        None => Identify::non_configured(window, now, out),
    });
    requests.unwrap()
}

/// Node-ids in the order of the devices.
fn nodes(session: &TestSession) -> Vec<Option<u8>> {
    let devices = session.bus().stations().0.iter();
    devices.map(|device| device.is_configured().then(|| device.node().raw())).collect()
}

#[test]
fn golden_fastscan_finds_one_device() {
    let (mut session, wire) = unconfigured(&[0x0A]);
    let scan = Job { inquire: true, ..Job::new(Selection::Fastscan) };
    let report = carry(&mut session, scan).unwrap();
    assert_eq!((report.address, report.node), (Some(drive(0x0A)), Some(None)));
    compare("lss_fastscan.log", &wire.transcript(usize::MAX));
}

#[test]
fn golden_configuration_sets_the_first_node_id() {
    let (mut session, wire) = unconfigured(&[0x0A]);
    let job = Job {
        bit_rate: BitRate::of_kilobits(500),
        ..configure(Selection::Address(drive(0x0A)), Some(node(9)))
    };
    let report = carry(&mut session, job).unwrap();
    assert!(report.is_booted);
    assert_eq!(session.bus().stations().0[0].bit_rate(), BitRate::of_kilobits(500));
    compare("lss_configure.log", &wire.transcript(usize::MAX));
}

#[test]
fn unconfigured_devices_get_node_ids_by_fastscan() {
    let serials = [77, 3, 0xFFFF_FFFF, 0];
    let (mut session, wire) = unconfigured(&serials);
    assert_eq!(identify(&mut session, None), 4);
    for raw in 11..=14 {
        let report = carry(&mut session, configure(Selection::Fastscan, Some(node(raw)))).unwrap();
        assert!(report.is_booted, "node {raw}");
    }
    // Fastscan finds the lowest serial number first.
    assert_eq!(nodes(&session), [Some(13), Some(12), Some(14), Some(11)]);
    let none = carry(&mut session, configure(Selection::Fastscan, Some(node(15))));
    assert_eq!(none, Err(LssError::NoneUnconfigured));
    assert_eq!(identify(&mut session, None), 0);
    let boot_ups = (0x70B..=0x70E).map(|id| wire.since(Instant::ZERO, id).len());
    assert_eq!(boot_ups.collect::<Vec<_>>(), [1; 4]);
}

#[test]
fn devices_in_the_identification_range_reply() {
    let (mut session, _) = session(Devices::from_numbers(&[(1, 7), (2, 8), (3, 9)]));
    let whom =
        |revision, serial| Description { vendor: 0xF8C, product: 0x0402_0010, revision, serial };
    let every_revision = [0, u32::MAX];
    assert_eq!(identify(&mut session, Some(whom(every_revision, [8, 100]))), 2);
    assert_eq!(identify(&mut session, Some(whom(every_revision, [10, 100]))), 0);
    assert_eq!(identify(&mut session, Some(whom([0, 0xFFFF], [7, 9]))), 0);
}

#[test]
fn node_id_is_not_configured_on_several_devices_at_once() {
    let (mut session, wire) = session(Devices::from_numbers(&[(1, 7), (2, 8)]));
    let refused = carry(&mut session, configure(Selection::All, Some(node(9))));
    assert!(matches!(refused, Err(LssError::Several(_))), "{refused:?}");
    let frames = wire.since(Instant::ZERO, 0x7E5);
    assert!(frames.iter().all(|(_, frame)| frame.data()[0] != 0x11), "configured: {frames:?}");
    assert_eq!(frames.last().unwrap().1, Request::SwitchGlobal(LssState::Waiting).frame());
}

#[test]
fn device_is_released_during_a_bit_rate_change() {
    let (mut session, _) = session(Devices::from_numbers(&[(1, 7)]));
    let bit_rate = BitRate::of_kilobits(250);
    let job = Job {
        bit_rate,
        activate: Some(100),
        ..configure(Selection::Address(drive(7)), Some(node(9)))
    };
    let start = session.now();
    carry(&mut session, job).unwrap();
    assert!(session.now().since(start) > Duration::from_millis(200));
    assert_eq!(session.bus().stations().0[0].bit_rate(), bit_rate);
    let silent = carry(&mut session, Job { inquire: true, ..Job::new(Selection::Selected) });
    assert!(matches!(silent, Err(LssError::Timeout(_))), "{silent:?}");
}

/// Procedure that is abandoned after a number of received frames.
struct AbandoningProcedure<P>(P, u32);

impl<P: Procedure> Procedure for AbandoningProcedure<P> {
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
fn interrupted_job_leaves_no_device_in_configuration_state() {
    for frames in 1..=9 {
        let (mut session, _) = session(Devices::from_numbers(&[(1, 7)]));
        let job = configure(Selection::Address(drive(7)), Some(node(9)));
        session
            .run(|now, out| AbandoningProcedure(Master::start(job, TIMEOUTS, now, out), frames))
            .unwrap();
        let silent = carry(&mut session, Job { inquire: true, ..Job::new(Selection::Selected) });
        assert!(matches!(silent, Err(LssError::Timeout(_))), "after {frames} frames: {silent:?}");
    }
}
