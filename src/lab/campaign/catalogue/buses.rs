//! Adapters, buses, the process and the host; and strangers on the bus.

use std::time::Duration;

use crate::campaign::draw::Draw;
use crate::campaign::injection::Expectation;
use crate::campaign::injection::Injection;
use crate::campaign::injection::Place;
use crate::campaign::kind::KILLED;
use crate::campaign::kind::Kind;
use crate::campaign::kind::NO_CAUSE;
use crate::campaign::kind::kind;
use bus::BusFault;
use bus::Disturbance;
use bus::HostFault;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::layout::Direction;
use canopen::sync;
use node::cause::Kind as Cause;

pub(super) const KINDS: &[Kind] = &[
    kind(21, "transmit queue full", &[Cause::QueueFull], |draw, at| {
        let by_timers = timers(at);
        disturbed(draw, at, Disturbance::Full, by_timers)
    }),
    kind(22, "adapter stuck", &[Cause::EchoMissing, Cause::SamplesMissing], |draw, at| {
        disturbed(draw, at, Disturbance::Stuck, timers(at))
    }),
    kind(22, "adapter stalls", &[Cause::EchoMissing, Cause::SamplesMissing], |draw, at| {
        stalled(draw, at, 10_000, timers(at))
    }),
    kind(
        22,
        "adapter stalls for a moment",
        &[Cause::EchoMissing, Cause::SamplesMissing],
        |draw, at| stalled(draw, at, 0, MOMENT),
    ),
    kind(23, "bus-off", &[Cause::BusOff], |draw, at| {
        disturbed(draw, at, Disturbance::Fault(BusFault::Off), timers(at))
    }),
    kind(23, "error passive", &[Cause::BusPassive], |draw, at| {
        let stop = Expectation::Stop(at.cycles(2));
        disturbed(draw, at, Disturbance::Fault(BusFault::Passive), stop)
    }),
    kind(23, "error warning", NO_CAUSE, |draw, at| {
        disturbed(draw, at, Disturbance::Fault(BusFault::Warning), Expectation::GoOn)
    }),
    kind(24, "interface down", &[Cause::BusDown], |draw, at| {
        disturbed(draw, at, Disturbance::Down, timers(at))
    }),
    kind(24, "adapter unplugged", &[Cause::BusDown], |draw, at| {
        disturbed(draw, at, Disturbance::Fault(BusFault::Down), timers(at))
    }),
    kind(25, "backlog after a stop", &[Cause::Overrun], backlog),
    kind(26, "bus flooded", &[Cause::EchoMissing, Cause::SamplesMissing], flooded),
    kind(26, "foreign SYNC", &[Cause::ForeignMaster], |draw, at| {
        stranger(draw, at, "kind = \"foreign_sync\"")
    }),
    kind(26, "foreign NMT", &[Cause::ForeignMaster], foreign_nmt),
    kind(26, "foreign targets", &[Cause::ForeignMaster], foreign_targets),
    kind(26, "foreign download", &[Cause::ForeignMaster], foreign_download),
    kind(
        26,
        "random frames, own identifiers",
        &[
            Cause::ForeignMaster,
            Cause::Emergency,
            Cause::Rebooted,
            Cause::LeftOperational,
            Cause::DriveLeft,
            Cause::Duplicate,
            Cause::SamplesMissing,
        ],
        |draw, at| random_frames(draw, at, true),
    ),
    kind(26, "random frames, other identifiers", NO_CAUSE, |draw, at| {
        random_frames(draw, at, false)
    }),
    kind(27, KILLED, &[Cause::Overrun], killed),
    kind(28, "process stands still", &[Cause::Overrun], stands_still),
    kind(29, "one cycle late", NO_CAUSE, one_cycle_late),
    kind(29, "stall within a cycle", &[Cause::Emergency, Cause::DriveLeft], stall_within_cycle),
    kind(31, "wall clock set", NO_CAUSE, clock_set),
    kind(31, "host suspended", &[Cause::Suspended], suspended),
];

/// By the drives' own RPDO timers, or by the node where it still reaches them.
fn timers(at: &Place<'_>) -> Expectation {
    let timer = Duration::from_millis(u64::from(at.config.safety.rpdo_timer_ms) + 1);
    Expectation::Mute(timer.max(at.cycles(6)), at.cycles(GIVEN_UP))
}

/// Cycles until the node must have given up a bus: a cycle that has begun, two whose SYNC is not seen, and the one
/// in which that is known.
const GIVEN_UP: u32 = 4;

fn bus(draw: &mut Draw, at: &Place<'_>) -> Channel {
    draw.among(&at.config.channels()).copied().unwrap_or_default()
}

fn disturbed(
    draw: &mut Draw,
    at: &Place<'_>,
    how: Disturbance,
    expectation: Expectation,
) -> Injection {
    let channel = bus(draw, at);
    Injection::host_faults(vec![(Duration::ZERO, HostFault::Bus(channel, Some(how)))], expectation)
}

/// Too short for drives to notice. What waits in the adapter nobody can take back, so it acts at the SYNC that
/// waits behind it; not for longer than a drive's RPDO timer.
const MOMENT: Expectation =
    Expectation::Either("what comes late may act until the drives' RPDO timers run out");

/// For so many µs and more. What was queued meanwhile comes out at the end.
fn stalled(draw: &mut Draw, at: &Place<'_>, least: u64, expectation: Expectation) -> Injection {
    let channel = bus(draw, at);
    let span = Duration::from_micros(least + draw.below(least.saturating_mul(4).max(10_000)));
    let host_faults = vec![
        (Duration::ZERO, HostFault::Bus(channel, Some(Disturbance::Stalled))),
        (span, HostFault::Bus(channel, None)),
    ];
    Injection::host_faults(host_faults, expectation)
}

/// With an identifier that wins against everything of the cycle.
fn flooded(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let cob_id = u16::try_from(1 + draw.below(0x7E)).unwrap_or(1);
    let frame = Frame::new(cob_id, draw.bits().to_le_bytes());
    disturbed(draw, at, Disturbance::Flood(frame), timers(at))
}

/// Another master: nobody knows whom else it commands.
fn stranger(draw: &mut Draw, at: &Place<'_>, keys: &str) -> Injection {
    let Channel(bus) = bus(draw, at);
    let keys = format!("{keys}; bus = {bus}");
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(2)))
}

fn foreign_nmt(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let commands = ["start", "stop", "pre_operational", "reset_node", "reset_communication"];
    let command = draw.among(&commands).copied().unwrap_or("stop");
    let node = draw.joint();
    stranger(
        draw,
        at,
        &format!("kind = \"foreign_nmt\"; command = \"{command}\"; node_id = {node}"),
    )
}

fn foreign_targets(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint().entry(&at.config.joints);
    let bus = joint.channel.0;
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
    let payload = draw.digits(bytes);
    let keys = format!(
        "kind = \"foreign_frame\"; cob_id = 0x{cob_id:03X}; payload = \"{payload}\"; bus = {bus}"
    );
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(2)))
}

/// SDO requests, before the node-id is added.
const SDO_REQUEST: u16 = 0x600;

/// Another client writes one of the timers by which a drive stops without its master.
fn foreign_download(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint().entry(&at.config.joints);
    let (bus, node) = (joint.channel.0, joint.node.raw());
    let cob_id = SDO_REQUEST + u16::from(node);
    // 1400h:5 and 1016h:1 become zero; 1F50h:1 begins by blocks.
    let payloads = ["2B00140500000000", "2316100100000000", "C2501F0100000000"];
    let payload = draw.among(&payloads).copied().unwrap_or("2B00140500000000");
    let keys = format!(
        "kind = \"foreign_frame\"; cob_id = 0x{cob_id:03X}; payload = \"{payload}\"; bus = {bus}"
    );
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(2)))
}

/// A dozen of random bytes within 50 ms, on identifiers that this network uses, or on others.
fn random_frames(draw: &mut Draw, at: &Place<'_>, are_own: bool) -> Injection {
    let mut entries = String::new();
    let mut after = Duration::ZERO;
    for _ in 0..12 {
        let cob_id = loop {
            let cob_id = draw.below(0x800);
            if is_used(cob_id) == are_own {
                break cob_id;
            }
        };
        let bytes = draw.below(9);
        let (payload, Channel(bus)) = (draw.digits(bytes), bus(draw, at));
        entries.push_str(&at.fault_after(
            after,
            &format!(
                "kind = \"foreign_frame\"; cob_id = 0x{cob_id:03X}; payload = \"{payload}\"; bus = {bus}"
            ),
        ));
        after += Duration::from_micros(draw.below(4_000));
    }
    let why = "some of them are as if from a node or a master";
    let expectation = if are_own { Expectation::Either(why) } else { Expectation::GoOn };
    Injection::scripted(entries, expectation)
}

/// Whether an identifier of the predefined connection set is one of nodes 1 to 6, 16 and 127 or of all.
const fn is_used(cob_id: u64) -> bool {
    let node = cob_id & 0x7F;
    // TIME and LSS are for all, and so is everything of no node.
    node == 0 || cob_id < 0x80 || cob_id >= 0x780 || node <= 6 || node == 16 || node == 127
}

/// So long that it is as good as for ever.
fn killed(_: &mut Draw, at: &Place<'_>) -> Injection {
    let timer = Duration::from_millis(u64::from(at.config.safety.rpdo_timer_ms) + 1);
    let host_fault = HostFault::Stopped(Duration::from_millis(300));
    Injection::host_faults(vec![(Duration::ZERO, host_fault)], Expectation::Release(timer))
        .watched_for(Duration::from_millis(350))
}

/// More than five cycles: the first frame after that is zero.
fn stands_still(draw: &mut Draw, at: &Place<'_>) -> Injection {
    stopped(draw, at, [7, 20])
}

/// So long that more samples wait to be read than may: what is read first is old.
fn backlog(draw: &mut Draw, at: &Place<'_>) -> Injection {
    stopped(draw, at, [20, 120])
}

/// For so many cycles.
fn stopped(draw: &mut Draw, at: &Place<'_>, [least, most]: [u32; 2]) -> Injection {
    let more = u64::try_from(at.cycles(most - least).as_micros()).unwrap_or(0);
    let span = at.cycles(least) + Duration::from_micros(draw.below(more));
    let expectation = Expectation::Stop(span + at.cycles(2));
    Injection::host_faults(vec![(Duration::ZERO, HostFault::Stopped(span))], expectation)
        .watched_for(span + Duration::from_millis(150))
}

/// A cycle that is skipped and not made up for.
fn one_cycle_late(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let micros = u64::try_from(at.config.period.as_micros()).unwrap_or(1_000);
    let span = Duration::from_micros(1 + draw.below(micros));
    Injection::host_faults(vec![(Duration::ZERO, HostFault::Stopped(span))], Expectation::GoOn)
}

/// After any frame of a cycle that is sent or read: torques that are late then are dropped (I5).
fn stall_within_cycle(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let plans = at.config.node_plans();
    let of_every_sync = plans.iter().flat_map(|(_, plan)| &plan.pdos).filter(|pdo| {
        let service = pdo.service.as_ref();
        service.is_some_and(|service| service.transmission.syncs() == Some(1))
    });
    let frames: Vec<u16> =
        [sync::COB_ID].into_iter().chain(of_every_sync.map(|pdo| pdo.cob_id)).collect();
    let after = draw.among(&frames).copied().unwrap_or(sync::COB_ID);
    let periods = draw.within(0.3, 3.9);
    let host_fault = HostFault::StoppedAfter(after, at.config.period.mul_f64(periods));
    let why = "the drives' RPDO timers may run out before the next torque";
    let expectation = if periods < 1.2 { Expectation::GoOn } else { Expectation::Either(why) };
    Injection::host_faults(vec![(Duration::ZERO, host_fault)], expectation)
}

fn clock_set(draw: &mut Draw, _: &Place<'_>) -> Injection {
    let wall = Duration::from_secs(draw.below(4_000_000_000));
    Injection::host_faults(vec![(Duration::ZERO, HostFault::ClockSet(wall))], Expectation::GoOn)
}

fn suspended(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let span = Duration::from_millis(50 + draw.below(200));
    let expectation = Expectation::Stop(span + at.cycles(2));
    Injection::host_faults(vec![(Duration::ZERO, HostFault::Suspended(span))], expectation)
        .watched_for(span + Duration::from_millis(150))
}
