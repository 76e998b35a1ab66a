//! Faults of frames of devices: lost, late, duplicated, corrupted, or sent by another node.

use std::time::Duration;

use crate::catalogue::pdo_with;
use crate::criterion::Criterion;
use crate::injection::{Conditions, Injection};
use crate::kind::{CaseKind, NO_CAUSE, kind};
use crate::random::{Random, rounded};
use crate::situation::Situation;
use crate::timers;
use canopen::error_codes;
use canopen::object::Object;
use config::Layout;
use faults::{DeviceFault, Effect, Extent, FaultKind, FrameFault, Service, Target};
use node::cause::CauseKind;
use sim::scenario::Entry;
use sim::scenario::operator::Move;
use units::numbering::Joint;

pub(super) const KINDS: &[CaseKind] = &[
    kind(3, "TPDO lost", &[CauseKind::SamplesMissing], |random, at| {
        of_tpdo(random, at, Effect::Drop, Criterion::Stop(at.limit()))
    }),
    kind(3, "TPDOs lost now and then", LOSSES, tpdo_share),
    kind(3, "one TPDO lost", NO_CAUSE, |random, at| one_lost(random, at, TPDO)),
    kind(3, "SYNC missing", &[CauseKind::SamplesMissing], sync_lost),
    kind(3, "TPDO of another length", &[CauseKind::SamplesMissing], resized),
    kind(4, "TPDO late by less than 3 cycles", LOSSES, slightly_late),
    kind(4, "TPDO late by more", LOSSES, late),
    kind(4, "TPDOs overtake each other", OUT_OF_ORDER, reordered),
    kind(4, "TPDOs grow old", OLD, growing_delay),
    kind(5, "TPDO frozen", FROZEN, frozen),
    kind(6, "TPDO twice", &[CauseKind::Duplicate], |random, at| {
        of_tpdo(random, at, Effect::Duplicate, second_node(at))
    }),
    kind(6, "two drives of one node-id", TWO_DRIVES, imitated),
    kind(12, "TPDO corrupted", &[CauseKind::PositionJumped], corrupted),
    kind(13, "RPDO lost", COMMANDS_LOST, rpdo_lost),
    kind(13, "controlword lost", COMMANDS_LOST, controlword_lost),
    kind(13, "one RPDO lost", NO_CAUSE, |random, at| one_lost(random, at, RPDO)),
];

/// TPDO with the position of a drive.
const TPDO: Service = Service::Tpdo(1);

/// RPDO with the target torque (6071h) of a drive.
const RPDO: Service = Service::Rpdo(1);

/// Causes of two drives with one node-id: if the second one answers first, the position appears to jump.
const TWO_DRIVES: &[CauseKind] = &[CauseKind::Duplicate, CauseKind::PositionJumped];

/// Causes of reordered samples, which leave SYNC windows empty; late ones may then exceed the number of SYNCs.
const OUT_OF_ORDER: &[CauseKind] = &[
    CauseKind::SamplesMissing,
    CauseKind::SamplesRare,
    CauseKind::SamplesOverdue,
    CauseKind::Duplicate,
];

/// Causes of lost or late samples: three in succession, one in twenty, or more than ten overdue.
const LOSSES: &[CauseKind] =
    &[CauseKind::SamplesMissing, CauseKind::SamplesRare, CauseKind::SamplesOverdue];

fn frames(at: &Conditions<'_>, joint: Joint, fault: FrameFault) -> Entry {
    at.fault(Target::Joint(joint), FaultKind::Frames(fault))
}

/// Returns an effect on every TPDO 1 of a drive.
fn of_tpdo(
    random: &mut Random,
    at: &Conditions<'_>,
    effect: Effect,
    criterion: Criterion,
) -> Injection {
    Injection::new([frames(at, random.joint(), FrameFault::on_service(TPDO, effect))], criterion)
}

/// Returns a stop within two cycles after the limit: the running one, and the one until the first wrong sample.
fn second_node(at: &Conditions<'_>) -> Criterion {
    Criterion::Stop(at.limit() + at.cycles(2))
}

fn resized(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let bytes = u8::try_from(random.below(4)).unwrap_or(0);
    of_tpdo(random, at, Effect::Resize(bytes), Criterion::Stop(at.limit()))
}

/// Drops more than one in twenty samples within a second.
fn tpdo_share(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let (joint, share) = (random.joint(), rounded(random.within(0.1, 0.2), 3));
    let fault = FrameFault::on_service(TPDO, Effect::Drop).to(Extent::Share(share));
    let within = Duration::from_millis(1_100) + at.cycles(2);
    Injection::new([frames(at, joint, fault)], Criterion::ReflectionOff(within))
        .observed_for(within + Duration::from_millis(50))
}

fn one_lost(random: &mut Random, at: &Conditions<'_>, service: Service) -> Injection {
    let fault = FrameFault::on_service(service, Effect::Drop).to(Extent::First(1));
    Injection::new([frames(at, random.joint(), fault)], Criterion::GoesOn)
}

fn sync_lost(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let fault = FrameFault::on_service(Service::Sync, Effect::Drop);
    Injection::new([frames(at, random.joint(), fault)], Criterion::Stop(at.limit()))
}

/// Returns a delay of this number of cycles, rounded to 1 µs.
fn delay(at: &Conditions<'_>, cycles: f64, reorders: bool) -> FrameFault {
    let millis = rounded(cycles * at.config.period.as_secs_f64() * 1e3, 3);
    let by = Duration::from_secs_f64(millis * 1e-3);
    FrameFault::on_service(TPDO, Effect::Delay { by, reorders })
}

fn slightly_late(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let cycles = random.within(0.2, 2.0);
    let criterion = Criterion::Either("a constant lateness looks like none");
    Injection::new([frames(at, random.joint(), delay(at, cycles, false))], criterion)
}

fn late(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let cycles = random.within(4.0, 20.0);
    let fault = frames(at, random.joint(), delay(at, cycles, false));
    Injection::new([fault], Criterion::Stop(at.limit()))
}

fn reordered(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let cycles = random.within(0.5, 3.0);
    let fault = delay(at, cycles, true).to(Extent::Share(0.3));
    let criterion = Criterion::Either("a late sample fills its own window");
    Injection::new([frames(at, random.joint(), fault)], criterion)
}

/// Returns a delay that grows by one cycle every 50 cycles, as behind a growing queue, up to 16 cycles.
fn growing_delay(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint();
    let step = at.cycles(50);
    let steps = (1..=16).map(|age| {
        let fault = FaultKind::Frames(delay(at, f64::from(age), false));
        let fault = at.fault_after(step * (age - 1), Target::Joint(joint), fault);
        Entry::Fault(fault.lasting(step))
    });
    // The balance drops one overdue sample in 250 cycles, so more than ten are overdue at an age of 14 cycles.
    let within = at.cycles(14 * 50);
    Injection::new(steps.collect::<Vec<_>>(), Criterion::Stop(within))
        .observed_for(within + Duration::from_millis(150))
}

/// Causes of samples that grow old: a hold with that delay swings, and ends before.
const OLD: &[CauseKind] = &[CauseKind::SamplesOverdue, CauseKind::NotFollowing, CauseKind::Blocked];

/// Causes of a position that stays the same: a joint that is moved by a hold does not follow, or is blocked.
const FROZEN: &[CauseKind] = &[
    CauseKind::PositionFrozen,
    CauseKind::TorqueDiffers,
    CauseKind::NotFollowing,
    CauseKind::Blocked,
];

fn frozen(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let criterion = Criterion::Either("visible only under torque while a neighbour moves");
    of_tpdo(random, at, Effect::Freeze, criterion).observed_for(Duration::from_millis(800))
}

/// Gives two drives of one bus the same node-id; their positions must differ.
fn imitated(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint();
    let channel = |joint: Joint| joint.entry(&at.config.joints).channel;
    let others: Vec<Joint> = Joint::ALL
        .into_iter()
        .filter(|by| *by != joint && channel(*by) == channel(joint))
        .collect();
    let by = random.one_of(&others).copied().unwrap_or(joint);
    let fault = FaultKind::Imitation { by, service: TPDO };
    Injection::new([at.fault(Target::Joint(joint), fault)], second_node(at))
}

/// Inverts a high bit of the position in the frame. The first wrong position is discarded.
fn corrupted(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint();
    let channel = joint.entry(&at.config.joints).channel;
    let bus = at.config.buses.get(usize::from(channel.0));
    let before = match bus.map(|bus| bus.layout) {
        Some(Layout::PerDrive) | None => 2,
        Some(Layout::Grouped) => 0,
    };
    let bit = 1_u32 << (20 + random.below(11));
    let mut mask = [0; 8];
    for (to, from) in mask.iter_mut().skip(before).zip(bit.to_le_bytes()) {
        *to = from;
    }
    let fault = FrameFault::on_service(TPDO, Effect::Corrupt(mask));
    Injection::new([frames(at, joint, fault)], Criterion::Stop(at.limit() + at.cycles(1)))
}

/// Causes of lost RPDOs: the drive stops by its timer, or the node detects that it holds its target.
const COMMANDS_LOST: &[CauseKind] = &[
    CauseKind::Emergency,
    CauseKind::DriveLeft,
    CauseKind::TargetNotTaken,
    CauseKind::TorqueDiffers,
];

/// Drops the RPDOs of a drive. Its timer stops it, and its EMCY stops the others two cycles later. A drive without that
/// timer holds its target until the node detects it and switches the drive off by SDO. The hand moves to change the
/// target.
fn rpdo_lost(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint();
    let fault = frames(at, joint, FrameFault::on_service(RPDO, Effect::Drop));
    if at.has_rpdo_timer(joint) {
        let within = at.limit_for(joint) + at.cycles(2);
        return Injection::new([fault], Criterion::Stop(within));
    }
    let by_sdo = timers::power_off_by_sdo(at.config) + at.cycles(4);
    let within = at.limit_for(joint) + by_sdo;
    let begin = at.onset_s().max(at.situation.rests_s());
    let injection = Injection::new([fault, hand_turns(at, begin)], Criterion::TorqueFree(within));
    let waits = Duration::from_secs_f64(begin - at.onset_s());
    Injection { cut_off: Some(joint), loses_commands: true, ..injection }
        .observed_for(waits + Duration::from_millis(900))
}

/// Returns a motion of the hand that changes the torque of every joint.
fn hand_turns(at: &Conditions<'_>, begin_s: f64) -> Entry {
    let to_m = match at.situation {
        Situation::Ready | Situation::Armed | Situation::Zeroed | Situation::Parking => {
            [0.08, 0.06, 0.05]
        }
        Situation::Free => [0.08, 0.12, 0.05],
        Situation::Contact => [0.06, 0.05, 0.05],
    };
    Entry::Move(Move::new(begin_s, 0.6, to_m).turning([0.4, 0.4, 0.4]))
}

/// Drops the controlwords of a drive, then stops the node by the EMCY of another. If its only RPDO is lost, the drive
/// receives no target either. It stops by its RPDO timer, or is switched off 100 ms after the stop.
fn controlword_lost(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let (joint, other) = (random.joint(), random.joint());
    let rpdo = pdo_with(at, joint, Object::CONTROLWORD);
    let service = Service::Rpdo(rpdo.map_or(1, |rpdo| rpdo.number));
    let lost = frames(at, joint, FrameFault::on_service(service, Effect::Drop));
    let after = random.duration(0.001, 0.02);
    let emergency = DeviceFault::Emergency { code: error_codes::OVER_CURRENT, register: 1 };
    let emergency =
        Entry::Fault(at.fault_after(after, Target::Joint(other), FaultKind::Device(emergency)));
    let stopped = after + at.limit_of(7) + at.cycles(2);
    let held = Duration::from_millis(100) + timers::power_off_by_sdo(at.config) + at.cycles(4);
    let receives_targets = service != RPDO;
    let free = if receives_targets { at.cycles(1) } else { held };
    let injection = Injection::new([lost, emergency], Criterion::TorqueFree(stopped + free));
    Injection { loses_commands: true, ..injection }.observed_for(Duration::from_millis(300))
}
