//! Faults of adapters, buses, process and host, and frames of other masters.

use std::ops::Range;
use std::time::Duration;

use crate::criterion::Criterion;
use crate::injection::{Conditions, Injection};
use crate::kind::{CaseKind, KILLED, NO_CAUSE, kind};
use crate::random::Random;
use crate::timers;
use canopen::frame::{Channel, Frame};
use canopen::layout::Direction;
use canopen::nmt::Order;
use canopen::{NmtCommand, NodeId, sync};
use faults::{Disturbance, Fault, FaultKind, HostFault, Target};
use node::cause::CauseKind;
use sim::scenario::Entry;

pub(super) const KINDS: &[CaseKind] = &[
    kind(21, "transmit queue full", &[CauseKind::QueueFull], |random, at| {
        disturbed(random, at, Disturbance::QueueFull, abandoned(at))
    }),
    kind(
        22,
        "adapter stuck",
        &[CauseKind::TransmitUnconfirmed, CauseKind::SamplesMissing],
        |random, at| disturbed(random, at, Disturbance::AdapterStuck, abandoned(at)),
    ),
    kind(
        22,
        "adapter stalls",
        &[CauseKind::TransmitUnconfirmed, CauseKind::SamplesMissing],
        |random, at| stalled(random, at, long_stall(at)..5 * long_stall(at), abandoned(at)),
    ),
    kind(
        22,
        "adapter stalls for a moment",
        &[CauseKind::TransmitUnconfirmed, CauseKind::SamplesMissing],
        |random, at| stalled(random, at, 0..long_stall(at), BRIEF_STALL),
    ),
    kind(23, "bus-off", &[CauseKind::BusOff], |random, at| {
        disturbed(random, at, Disturbance::BusOff, abandoned(at))
    }),
    kind(23, "error passive", &[CauseKind::BusPassive], |random, at| {
        disturbed(random, at, Disturbance::ErrorPassive, Criterion::Stop(at.cycles(2)))
    }),
    kind(23, "error warning", NO_CAUSE, |random, at| {
        disturbed(random, at, Disturbance::ErrorWarning, Criterion::GoesOn)
    }),
    kind(24, "interface down", &[CauseKind::BusDown], |random, at| {
        disturbed(random, at, Disturbance::InterfaceDown, abandoned(at))
    }),
    kind(24, "adapter unplugged", &[CauseKind::BusDown], |random, at| {
        disturbed(random, at, Disturbance::AdapterUnplugged, abandoned(at))
    }),
    kind(25, "backlog after a stop", &[CauseKind::Overrun], |random, at| {
        // More samples wait than may be read, so that the first ones are old.
        stopped(random, at, [20, 120])
    }),
    kind(26, "bus flooded", &[CauseKind::TransmitUnconfirmed, CauseKind::SamplesMissing], flooded),
    kind(26, "foreign SYNC", &[CauseKind::ForeignMaster], |random, at| {
        foreign(random, at, Frame::new(sync::COB_ID, []))
    }),
    kind(26, "foreign NMT", &[CauseKind::ForeignMaster], foreign_nmt),
    kind(26, "foreign targets", &[CauseKind::ForeignMaster], foreign_targets),
    kind(26, "foreign download", &[CauseKind::ForeignMaster], foreign_download),
    kind(
        26,
        "random frames, own identifiers",
        &[
            CauseKind::ForeignMaster,
            CauseKind::Emergency,
            CauseKind::Rebooted,
            CauseKind::LeftOperational,
            CauseKind::DriveLeft,
            CauseKind::Duplicate,
            CauseKind::SamplesMissing,
        ],
        |random, at| random_frames(random, at, true),
    ),
    kind(26, "random frames, other identifiers", NO_CAUSE, |random, at| {
        random_frames(random, at, false)
    }),
    kind(27, KILLED, &[CauseKind::Overrun], killed),
    kind(28, "process stopped", &[CauseKind::Overrun], |random, at| stopped(random, at, [7, 20])),
    kind(29, "one cycle late", NO_CAUSE, one_cycle_late),
    kind(
        29,
        "stall within a cycle",
        &[CauseKind::Emergency, CauseKind::DriveLeft],
        stall_within_cycle,
    ),
    kind(31, "wall clock set", NO_CAUSE, clock_set),
    kind(31, "host suspended", &[CauseKind::Suspended], suspended),
];

/// Demands that the drives stop by their own timers, or by the node where it still reaches them.
fn abandoned(at: &Conditions<'_>) -> Criterion {
    let within = at.limit_of(22).max(at.limit_of(21));
    Criterion::BusAbandoned(within, at.cycles(ABANDONED))
}

/// Cycles until the node must have abandoned a bus: the running cycle, two without transmit confirmation of SYNC, and the
/// one that detects them.
const ABANDONED: u32 = 4;

fn channel(random: &mut Random, at: &Conditions<'_>) -> Channel {
    random.one_of(&at.config.channels()).copied().unwrap_or_default()
}

fn disturbed(
    random: &mut Random,
    at: &Conditions<'_>,
    disturbance: Disturbance,
    criterion: Criterion,
) -> Injection {
    let target = Target::Bus(channel(random, at));
    Injection::new([at.fault(target, FaultKind::Bus(disturbance))], criterion)
}

/// Criterion of a stall that is shorter than the drives' timers. Frames in the adapter cannot be recalled: they act at the
/// next SYNC, for at most the time of a drive's timer.
const BRIEF_STALL: Criterion =
    Criterion::Either("late frames may act until the drives' own timers run out");

/// Returns the duration of a stall in which every drive stops by its own timer, in µs, at least 10 ms.
fn long_stall(at: &Conditions<'_>) -> u64 {
    let micros = timers::slowest(at.config).as_micros();
    u64::try_from(micros).unwrap_or(u64::MAX).max(10_000)
}

/// Returns a stall with a duration in µs within `range`; queued frames are sent at its end.
fn stalled(
    random: &mut Random,
    at: &Conditions<'_>,
    range: Range<u64>,
    criterion: Criterion,
) -> Injection {
    let channel = channel(random, at);
    let span = Duration::from_micros(range.start + random.below(range.end - range.start));
    let fault = Fault::of_bus(at.onset, channel, Disturbance::AdapterStalled).lasting(span);
    Injection::new([Entry::Fault(fault)], criterion)
}

/// Returns a flood of frames whose COB-ID wins arbitration against every frame of the cycle.
fn flooded(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let cob_id = u16::try_from(1 + random.below(0x7E)).unwrap_or(1);
    let frame = Frame::new(cob_id, random.bits().to_le_bytes());
    disturbed(random, at, Disturbance::Flood(frame), abandoned(at))
}

/// Returns a frame of a foreign master.
fn foreign(random: &mut Random, at: &Conditions<'_>, frame: Frame) -> Injection {
    let channel = channel(random, at);
    foreign_on(at, channel, frame)
}

fn foreign_on(at: &Conditions<'_>, channel: Channel, frame: Frame) -> Injection {
    let fault = FaultKind::ForeignFrame { frame, period: None };
    Injection::new([at.fault(Target::Bus(channel), fault)], Criterion::Stop(at.limit()))
}

fn foreign_nmt(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let commands = [
        NmtCommand::StartRemoteNode,
        NmtCommand::StopRemoteNode,
        NmtCommand::EnterPreOperational,
        NmtCommand::ResetNode,
        NmtCommand::ResetCommunication,
    ];
    let command = random.one_of(&commands).copied().unwrap_or(NmtCommand::StopRemoteNode);
    let node = NodeId::new(random.joint().number()).ok();
    foreign(random, at, Order { command, node }.frame())
}

fn foreign_targets(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint().entry(&at.config.joints);
    let plans = at.config.node_plans();
    let plan = plans.iter().find(|(_, plan)| joint.node == plan.node);
    let rpdo = plan.and_then(|(_, plan)| {
        plan.pdos.iter().find(|pdo| {
            let is_rpdo = pdo.direction == Direction::Receive;
            is_rpdo && pdo.service.is_some()
        })
    });
    let (cob_id, bytes) = rpdo.map_or((0x201, 4), |rpdo| {
        (rpdo.cob_id, rpdo.service.as_ref().map_or(4, |service| u64::from(service.bytes())))
    });
    foreign_on(at, joint.channel, frame_of(cob_id, &random.bytes(bytes)))
}

/// Returns a frame with this data, or without data if it is longer than 8 bytes.
fn frame_of(cob_id: u16, data: &[u8]) -> Frame {
    Frame::from_slice(cob_id, data).unwrap_or(Frame::new(cob_id, []))
}

/// Base COB-ID of SDO requests (CiA 301, 7.3.3); the node-id is added to it.
const SDO_REQUEST: u16 = 0x600;

/// Returns a download by a foreign SDO client to a timer by which a drive stops without its master.
fn foreign_download(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint().entry(&at.config.joints);
    let cob_id = SDO_REQUEST + u16::from(joint.node.raw());
    // 1400h:5 and 1016h:1 become zero; a block download to 1F50h:1 begins.
    let payloads = [
        [0x2B, 0x00, 0x14, 0x05, 0, 0, 0, 0],
        [0x23, 0x16, 0x10, 0x01, 0, 0, 0, 0],
        [0xC2, 0x50, 0x1F, 0x01, 0, 0, 0, 0],
    ];
    let payload = random.one_of(&payloads).copied().unwrap_or_default();
    foreign_on(at, joint.channel, Frame::new(cob_id, payload))
}

/// Returns twelve frames with random data within 50 ms, on COB-IDs of this network if `are_own`, else on others.
fn random_frames(random: &mut Random, at: &Conditions<'_>, are_own: bool) -> Injection {
    let mut entries = Vec::new();
    let mut after = Duration::ZERO;
    for _ in 0..12 {
        let cob_id = loop {
            let cob_id = u16::try_from(random.below(0x800)).unwrap_or(0);
            if is_used(cob_id) == are_own {
                break cob_id;
            }
        };
        let count = random.below(9);
        let frame = frame_of(cob_id, &random.bytes(count));
        let target = Target::Bus(channel(random, at));
        let fault = FaultKind::ForeignFrame { frame, period: None };
        entries.push(Entry::Fault(at.fault_after(after, target, fault)));
        after += Duration::from_micros(random.below(4_000));
    }
    let why = "some of them imitate a node or a master";
    let criterion = if are_own { Criterion::Either(why) } else { Criterion::GoesOn };
    Injection::new(entries, criterion)
}

/// Returns whether a COB-ID of the predefined connection set is one of nodes 1 to 6, 16 and 127, or a broadcast.
const fn is_used(cob_id: u16) -> bool {
    let node = cob_id & 0x7F;
    // TIME and LSS are broadcasts, and so is every COB-ID without a node-id.
    node == 0 || cob_id < 0x80 || cob_id >= 0x780 || node <= 6 || node == 16 || node == 127
}

fn host(at: &Conditions<'_>, fault: HostFault, span: Duration) -> [Entry; 1] {
    [Entry::Fault(Fault::of_host(at.onset, fault, span))]
}

/// Stops the process for longer than the case is observed.
fn killed(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let stopped = host(at, HostFault::ProcessStopped, Duration::from_millis(300));
    Injection::new(stopped, Criterion::TorqueFree(at.limit()))
        .observed_for(Duration::from_millis(350))
}

/// Stops the process for a number of cycles; its first targets afterwards must be zero.
fn stopped(random: &mut Random, at: &Conditions<'_>, [least, most]: [u32; 2]) -> Injection {
    let more = u64::try_from(at.cycles(most - least).as_micros()).unwrap_or(0);
    let span = at.cycles(least) + Duration::from_micros(random.below(more));
    let criterion = Criterion::Stop(span + at.cycles(2));
    Injection::new(host(at, HostFault::ProcessStopped, span), criterion)
        .observed_for(span + Duration::from_millis(150))
}

/// Delays the process such that one cycle is skipped and not repeated.
fn one_cycle_late(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let micros = u64::try_from(at.config.period.as_micros()).unwrap_or(1_000);
    let span = Duration::from_micros(1 + random.below(micros));
    Injection::new(host(at, HostFault::ProcessStopped, span), Criterion::GoesOn)
}

/// Stops the process after any frame of a cycle; torques that are late then must not be sent (I5).
fn stall_within_cycle(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let plans = at.config.node_plans();
    let of_every_sync = plans.iter().flat_map(|(_, plan)| &plan.pdos).filter(|pdo| {
        let service = pdo.service.as_ref();
        service.is_some_and(|service| service.transmission.syncs() == Some(1))
    });
    let frames: Vec<u16> =
        [sync::COB_ID].into_iter().chain(of_every_sync.map(|pdo| pdo.cob_id)).collect();
    let after = random.one_of(&frames).copied().unwrap_or(sync::COB_ID);
    let periods = random.within(0.3, 3.9);
    let fault = HostFault::ProcessStoppedAfter(after);
    let why = "the drives' RPDO timers may run out before the next torque";
    let criterion = if periods < 1.2 { Criterion::GoesOn } else { Criterion::Either(why) };
    Injection::new(host(at, fault, at.config.period.mul_f64(periods)), criterion)
}

fn clock_set(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let wall = Duration::from_secs(random.below(4_000_000_000));
    let fault = at.fault(Target::Host, FaultKind::Host(HostFault::ClockSet(wall)));
    Injection::new([fault], Criterion::GoesOn)
}

fn suspended(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let span = Duration::from_millis(50 + random.below(200));
    let criterion = Criterion::Stop(span + at.cycles(2));
    Injection::new(host(at, HostFault::Suspended(None), span), criterion)
        .observed_for(span + Duration::from_millis(150))
}
