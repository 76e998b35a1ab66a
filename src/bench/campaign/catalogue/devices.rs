//! Faults of drives and switch box: loss, reboot, failure, wrong measurements.

use std::time::Duration;

use crate::catalogue::pdo_with;
use crate::criterion::Criterion;
use crate::injection::{Conditions, Injection};
use crate::kind::{CaseKind, NO_CAUSE, armed, engaged, in_contact, kind, ready};
use crate::random::{Random, rounded};
use canopen::error_codes;
use canopen::frame::Frame;
use canopen::object::Object;
use canopen::watchdog::LifeSign;
use faults::{
    DeviceFault, Disconnection, Effect, FaultKind, FrameFault, SensorFault, Service, Target,
};
use node::cause::CauseKind;
use sim::quirks::Quirk;
use sim::scenario::Entry;
use sim::scenario::operator::Move;
use units::numbering::Joint;

pub(super) const KINDS: &[CaseKind] = &[
    kind(1, "drive unplugged", &[CauseKind::SamplesMissing], |random, at| {
        lost(random, at, Disconnection::Unplugged)
    }),
    kind(1, "wire cut", &[CauseKind::SamplesMissing], |random, at| {
        lost(random, at, Disconnection::WireCut)
    }),
    kind(1, "drive bus-off", &[CauseKind::SamplesMissing], |random, at| {
        lost(random, at, Disconnection::BusOff)
    }),
    kind(2, "drive heartbeat lost", &[CauseKind::HeartbeatLost], |random, at| {
        heartbeat_lost(at, Target::Joint(random.joint()))
    }),
    kind(2, "switch box heartbeat lost", &[CauseKind::HeartbeatLost], |_, at| {
        heartbeat_lost(at, Target::SwitchBox)
    }),
    kind(
        8,
        "drive heartbeat of another state",
        &[CauseKind::LeftOperational],
        heartbeat_of_another_state,
    ),
    kind(7, "emergency", &[CauseKind::Emergency], |random, at| {
        let target = Target::Joint(random.joint());
        emergency(random, at, target)
    }),
    kind(7, "emergency of the switch box", &[CauseKind::Emergency], |random, at| {
        emergency(random, at, Target::SwitchBox)
    }),
    kind(8, "drive fault", &[CauseKind::Emergency, CauseKind::DriveLeft], drive_fault),
    kind(8, "drive fault, no emergency", &[CauseKind::DriveLeft], drive_fault_without_emergency),
    kind(8, "safe torque off", &[CauseKind::DriveLeft, CauseKind::Emergency], |random, at| {
        let target = Target::Joint(random.joint());
        device(at, target, DeviceFault::SafeTorqueOff)
    }),
    // Its lost settings may be read before its boot-up message arrives.
    kind(9, "drive reboots", &[CauseKind::Rebooted, CauseKind::SettingChanged], |random, at| {
        device(at, Target::Joint(random.joint()), DeviceFault::Reboot)
    }),
    kind(9, "switch box reboots", &[CauseKind::Rebooted], |_, at| {
        device(at, Target::SwitchBox, DeviceFault::Reboot)
    }),
    engaged(10, "torque actual wrong", &[CauseKind::TorqueDiffers], torque_scaled),
    ready(10, "torque before arming", UNARMED_TORQUE, torque_before_arming),
    armed(10, "stored torque offset", NO_CAUSE, stored_offset),
    kind(12, "encoder jumps", &[CauseKind::PositionJumped], encoder_jump),
    engaged(5, "encoder frozen", &[CauseKind::PositionFrozen], encoder_frozen),
    in_contact(5, "encoder frozen in motion", &[CauseKind::PositionFrozen], frozen_in_motion),
    kind(13, "several drives unplugged", &[CauseKind::SamplesMissing], several_lost),
];

fn lost(random: &mut Random, at: &Conditions<'_>, how: Disconnection) -> Injection {
    let target = Target::Joint(random.joint());
    let fault = at.fault(target, FaultKind::Disconnection(how));
    Injection::new([fault], Criterion::Stop(at.limit()))
}

/// Disconnects several drives; missing samples detect them, as they detect a single one.
fn several_lost(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joints = [random.joint(), random.joint(), random.joint()];
    let unplugged = FaultKind::Disconnection(Disconnection::Unplugged);
    let faults = joints.map(|joint| at.fault(Target::Joint(joint), unplugged));
    Injection::new(faults, Criterion::Stop(at.limit_of(1)))
}

/// Stops a heartbeat. The limit is two cycles after the heartbeat time: the running one, and the one that detects it.
fn heartbeat_lost(at: &Conditions<'_>, target: Target) -> Injection {
    let within = at.limit() + at.cycles(2);
    let lost = FaultKind::Frames(FrameFault::on_service(Service::Heartbeat, Effect::Drop));
    Injection::new([at.fault(target, lost)], Criterion::Stop(within))
        .observed_for(within + Duration::from_millis(150))
}

/// Base COB-ID of heartbeats (CiA 301, 7.3.3); the node-id is added to it.
const HEARTBEAT: u16 = 0x700;

/// Toggle bit of an answer to node guarding (CiA 301, 7.2.8.2.2.1).
const TOGGLE: u8 = 0x80;

/// Sends one heartbeat with the state stopped or pre-operational under a drive's COB-ID; the drive keeps running. The
/// response of a guarded node is valid if its toggle bit has changed, so one with either bit is sent.
fn heartbeat_of_another_state(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let number = random.joint();
    let joint = number.entry(&at.config.joints);
    let state = if random.coin() { 0x04 } else { 0x7F };
    let plans = at.config.node_plans();
    let is_guarded = plans
        .get(number.index())
        .is_some_and(|(_, plan)| plan.watchdog(LifeSign::Guarding).is_some());
    let answers: &[u8] = if is_guarded { &[state, state | TOGGLE] } else { &[state] };
    let cob_id = HEARTBEAT + u16::from(joint.node.raw());
    let faults = answers.iter().map(|answer| {
        let frame = Frame::new(cob_id, [*answer]);
        let fault = FaultKind::ForeignFrame { frame, period: None };
        at.fault(Target::Bus(joint.channel), fault)
    });
    Injection::new(faults.collect::<Vec<_>>(), Criterion::Stop(at.limit()))
}

fn device(at: &Conditions<'_>, target: Target, fault: DeviceFault) -> Injection {
    Injection::new([at.fault(target, FaultKind::Device(fault))], Criterion::Stop(at.limit()))
}

/// Returns one of the error codes of drives (CiA 402).
fn error_code(random: &mut Random) -> u16 {
    random.one_of(&error_codes::OF_DRIVES).copied().unwrap_or(error_codes::OVER_CURRENT)
}

fn emergency(random: &mut Random, at: &Conditions<'_>, target: Target) -> Injection {
    device(at, target, DeviceFault::Emergency { code: error_code(random), register: 1 })
}

fn drive_fault(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let target = Target::Joint(random.joint());
    device(at, target, DeviceFault::DriveFault(error_code(random)))
}

/// Returns the inhibit time of the TPDO with a drive's statusword (1800h:3).
fn inhibit_time(at: &Conditions<'_>, joint: Joint) -> Duration {
    let pdo = pdo_with(at, joint, Object::STATUSWORD);
    let inhibit = pdo.and_then(|pdo| pdo.service?.inhibit_100us);
    Duration::from_micros(100 * u64::from(inhibit.unwrap_or(0)))
}

/// Raises a drive fault without EMCY: only the statusword reports it, after the inhibit time at most.
fn drive_fault_without_emergency(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.joint();
    let fault = at.fault(Target::Joint(joint), FaultKind::Device(DeviceFault::DriveFault(0)));
    Injection::new([fault], Criterion::Stop(at.limit() + inhibit_time(at, joint)))
}

/// Requires a stop only for joints with a load above [`LOADED`]: a wrong torque is not detectable without torque.
fn where_loaded(at: &Conditions<'_>, joint: Joint, within: Duration) -> Criterion {
    if at.weight(joint) > LOADED {
        Criterion::Stop(within)
    } else {
        Criterion::Either("visible only where the joint carries enough torque")
    }
}

/// Minimum load of a joint at which a wrong torque is detected, in ‰ of its largest torque.
const LOADED: f64 = 100.0;

/// Scales the torque of a shoulder joint, whose load makes a wrong scale detectable.
fn torque_scaled(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = if random.coin() { Joint::of::<3>() } else { Joint::of::<2>() };
    let factor = rounded(random.within(-10.0, -6.0), 2);
    let fault = FaultKind::Sensor(SensorFault::TorqueScaled(factor));
    // The torque comes at every hundredth SYNC in the grouped layout, and the second one counts.
    let within = at.limit().max(at.cycles(216));
    Injection::new([at.fault(Target::Joint(joint), fault)], where_loaded(at, joint, within))
        .observed_for(Duration::from_millis(600))
}

/// Causes that detect a torque without a command.
const UNARMED_TORQUE: &[CauseKind] = &[
    CauseKind::TorqueDiffers,
    CauseKind::TargetNotTaken,
    CauseKind::Overspeed,
    CauseKind::GripOverspeed,
    CauseKind::BeyondLimit,
];

/// Returns whether a drive has a torque offset (60B2h).
fn has_offset(at: &Conditions<'_>, joint: Joint) -> bool {
    joint.entry(&at.config.joints).eds.object(Object::TORQUE_OFFSET).is_some()
}

/// Returns a torque offset of 25 to 50 % of rated torque.
fn offset(random: &mut Random) -> i16 {
    let per_mille = i16::try_from(250 + random.below(250)).unwrap_or(250);
    if random.coin() { per_mille } else { -per_mille }
}

/// Time from zero torque until the drives are off, and for the last controlword.
const OFF_TIME: Duration = Duration::from_millis(115);

/// Makes a drive exert torque at a zero target, until the power stages are switched off after the stop.
fn torque_before_arming(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let (joint, offset) = (random.joint(), offset(random));
    let fault =
        at.fault(Target::Joint(joint), FaultKind::Device(DeviceFault::TorqueOffset(offset)));
    let noticed = at.limit().max(at.cycles(216));
    let within = noticed + OFF_TIME;
    let criterion = match has_offset(at, joint) {
        true => Criterion::TorqueFree(within),
        false => Criterion::GoesOn,
    };
    Injection::new([fault], criterion).observed_for(Duration::from_millis(600))
}

/// Gives a drive a stored torque offset (60B2h) before its boot. The master must write zero and read it back, so that no
/// offset acts.
fn stored_offset(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let (joint, offset) = (random.joint(), offset(random));
    let stored = Quirk::Stored(Object::TORQUE_OFFSET, u32::from(offset.cast_unsigned()));
    let quirk = has_offset(at, joint).then_some((joint, stored));
    Injection { quirk, ..Injection::new([], Criterion::GoesOn) }
}

/// Makes an encoder jump. The first wrong position is discarded; the limit starts at the second.
fn encoder_jump(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let sign = if random.coin() { 1.0 } else { -1.0 };
    let (joint, by) = (random.joint(), sign * random.within(0.2, 3.0));
    let fault = FaultKind::Sensor(SensorFault::PositionOffset(rounded(by, 4)));
    let criterion = Criterion::Stop(at.limit() + at.cycles(1));
    Injection::new([at.fault(Target::Joint(joint), fault)], criterion)
}

const FROZEN: FaultKind = FaultKind::Sensor(SensorFault::PositionFrozen);

fn encoder_frozen(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let criterion = Criterion::Either("visible only under torque while a neighbour moves");
    Injection::new([at.fault(Target::Joint(random.joint()), FROZEN)], criterion)
        .observed_for(Duration::from_millis(800))
}

/// Freezes the position of the elevation joint while the hand moves it and its neighbour. The motion changes the gravity
/// torque of even a light arm by a tenth, and keeps the grip below its speed limit.
fn frozen_in_motion(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let movement = Move::new(at.onset_s(), 0.6, [0.12, 0.0, 0.05]);
    let (elevation, after) = (Joint::of::<2>(), Duration::from_millis(100));
    let frozen = at.fault_after(after, Target::Joint(elevation), FROZEN);
    let criterion = where_loaded(at, elevation, at.limit() + after);
    Injection::new([Entry::Move(movement), Entry::Fault(frozen)], criterion)
        .observed_for(Duration::from_millis(900))
}
