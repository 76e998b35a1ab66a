//! Faults of a joint's zero: lost under torque, or set while the arm lies beside its rest posture.

use std::time::Duration;

use crate::criterion::Criterion;
use crate::injection::{Conditions, Injection, seconds};
use crate::kind::{CaseKind, NO_CAUSE, ready, zeroed};
use crate::lost_zeros::{self, LostZeros};
use crate::random::{Random, rounded};
use controller::arm::JointKind;
use faults::{DeviceFault, FaultKind, Target};
use node::cause::CauseKind;
use sim::scenario::operator::Console;
use sim::scenario::{ConsoleRequest, Entry};
use testbench::lost_zero::LostZero;
use units::numbering::Joint;

pub(super) const KINDS: &[CaseKind] = &[
    zeroed(
        51,
        "zero lost by a reboot",
        &[CauseKind::ZeroUnknown, CauseKind::Rebooted, CauseKind::SettingChanged],
        lost_by_a_reboot,
    ),
    ready(51, "cradle missed", DRIVEN, cradle_missed),
    ready(51, "cradle missed, single-turn", NO_CAUSE, single_turn_missed),
    ready(51, "cradle missed by a revolution", DRIVEN, revolution_missed),
];

/// Causes that a wrong weight may raise.
const DRIVEN: &[CauseKind] =
    &[CauseKind::UncommandedMotion, CauseKind::Overspeed, CauseKind::GripOverspeed];

/// Misses of the cradle, in degrees; of a prismatic joint half as many cm.
const MISSES: [f64; 4] = [1.0, 3.0, 6.0, 20.0];

/// Difference of miss and error that the arm's sinking into its cradle explains, in rad or m.
const SINKS: f64 = 0.009;

/// Time from the onset until the joints have been at rest for 1 s.
const AT_REST: Duration = Duration::from_millis(1_200);

/// Time between two requests.
const NEXT: Duration = Duration::from_millis(100);

/// Duration of the observation, which starts again with each request.
const OBSERVED: Duration = Duration::from_millis(1_400);

/// Restarts a drive whose encoder is incremental or single-turn, while its torque carries the arm.
fn lost_by_a_reboot(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let kind = if random.coin() { LostZero::Rest } else { LostZero::SingleTurn };
    let Some(joint) = random.one_of(&lost_zeros::joints(at.config)).copied() else {
        return without_effect();
    };
    let fault = at.fault(Target::Joint(joint), FaultKind::Device(DeviceFault::Reboot));
    let injection = Injection::new([fault], Criterion::Stop(at.limit()));
    Injection { zeros: Some(LostZeros { kind, miss: None }), ..injection }
}

/// Lays the arm beside its cradle, tries to arm, sets the zeros and arms: the miss is the error of the armed arm.
fn cradle_missed(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.one_of(&lost_zeros::joints(at.config)).copied();
    let degrees = random.one_of(&MISSES).copied().unwrap_or(1.0);
    let requests = [ConsoleRequest::Arm, ConsoleRequest::Zero, ConsoleRequest::Arm];
    let missed = joint.and_then(|joint| {
        let by = match joint.entry(&at.config.joints).plant.link.kind {
            JointKind::Revolute => degrees.to_radians(),
            JointKind::Prismatic => degrees * 0.005,
        };
        missed(at, LostZero::Rest, (joint, by), &requests, Some)
    });
    missed.unwrap_or_else(without_effect)
}

/// Lays the arm a revolution of a motor beside its cradle: no reading shows it.
fn revolution_missed(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.one_of(&lost_zeros::single_joints(at.config)).copied();
    let missed = joint.and_then(|joint| {
        let by = lost_zeros::revolution(at.config, joint);
        missed(at, LostZero::SingleTurn, (joint, by), &[ConsoleRequest::Arm], Some)
    });
    missed.unwrap_or_else(without_effect)
}

/// Lays the arm a part of a revolution beside its cradle: arming is refused.
fn single_turn_missed(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let joint = random.one_of(&lost_zeros::single_joints(at.config)).copied();
    let missed = joint.and_then(|joint| {
        let by = lost_zeros::revolution(at.config, joint) * random.within(0.3, 0.7);
        missed(at, LostZero::SingleTurn, (joint, by), &[ConsoleRequest::Arm], |_| None)
    });
    missed.unwrap_or_else(without_effect)
}

/// Returns the injection of an arm that lies beside its cradle, and is armed with at most the error that `allowed` returns
/// for the miss. `None` where the joint has no room for it.
fn missed(
    at: &Conditions<'_>,
    kind: LostZero,
    (joint, by): (Joint, f64),
    requests: &[ConsoleRequest],
    allowed: fn(f64) -> Option<f64>,
) -> Option<Injection> {
    let by = rounded(lost_zeros::with_room(at.config, joint, by)?, 6);
    let criterion = match allowed(by.abs()) {
        Some(error) => Criterion::Armed(error + SINKS),
        None => Criterion::Unarmed,
    };
    let times = [Duration::ZERO, AT_REST, AT_REST + NEXT];
    let times = times.into_iter().skip(times.len().saturating_sub(requests.len()));
    let entries: Vec<_> = times
        .zip(requests)
        .map(|(after, request)| Entry::Console(Console::new(seconds(at.onset + after), *request)))
        .collect();
    let injection = Injection::new(entries, criterion).observed_for(OBSERVED);
    Some(Injection { zeros: Some(LostZeros { kind, miss: Some((joint, by)) }), ..injection })
}

/// Returns the injection for an arm whose joints keep their zeros, or have no room for a miss.
fn without_effect() -> Injection {
    Injection::new([], Criterion::GoesOn)
}
