//! Faults of the operator, the switch box and the commanded side.

use std::time::Duration;

use crate::criterion::{Criterion, MayStop};
use crate::injection::{Conditions, Injection, seconds};
use crate::kind::{CaseKind, NO_CAUSE, armed, engaged, in_contact, kind, parking};
use crate::random::Random;
use crate::situation::Situation;
use faults::{
    ContactFault, Disconnection, Effect, FaultKind, FrameFault, Input, LinkFault, Service, Target,
};
use node::cause::CauseKind;
use sim::scenario::operator::{Console, Hold, Move, Switch};
use sim::scenario::{ConsoleRequest, Entry};

pub(super) const KINDS: &[CaseKind] = &[
    in_contact(11, "hand too fast", &[CauseKind::GripOverspeed, CauseKind::Overspeed], too_fast),
    engaged(33, "wrench not finite", &[CauseKind::LinkLost], not_finite),
    engaged(33, "wrench too large", &[CauseKind::LinkLost], too_large),
    engaged(33, "wrench large, but valid", NO_CAUSE, large),
    engaged(34, "link lost", &[CauseKind::LinkLost], |_, at| link(at, LinkFault::Lost)),
    engaged(35, "link frozen", &[CauseKind::LinkLost], |_, at| link(at, LinkFault::Frozen)),
    engaged(37, "link answers another node", &[CauseKind::LinkLost], answers_another),
    engaged(34, "link lost for a moment", NO_CAUSE, link_briefly_lost),
    engaged(47, "far side holds", &[CauseKind::FarSideHolds], |_, at| link(at, LinkFault::Held)),
    engaged(48, "link slow", &[CauseKind::LinkSlow], |_, at| link(at, LinkFault::Slow)),
    engaged(38, "deadman released", NO_CAUSE, deadman_released),
    kind(
        38,
        "switch box unplugged",
        &[CauseKind::HeartbeatLost, CauseKind::StatusMissing],
        switch_box_unplugged,
    ),
    kind(38, "disarmed", NO_CAUSE, disarmed),
    kind(39, "deadman channel stuck", &[CauseKind::DeadmanDisagrees], deadman_stuck),
    kind(39, "deadman bounces", NO_CAUSE, deadman_bounces),
    armed(39, "deadman touched", NO_CAUSE, deadman_touched),
    armed(39, "deadman bounces when pressed", NO_CAUSE, deadman_bounces_when_pressed),
    engaged(39, "reflection and reference bounce", NO_CAUSE, buttons_bounce),
    engaged(39, "switch box silent, a switch closed", NO_CAUSE, silent_while_closed),
    engaged(40, "reference pressed in motion", NO_CAUSE, reference_pressed),
    engaged(41, "reflection switched on", NO_CAUSE, reflection_switched),
    parking(52, "parking arm held fast", &[CauseKind::NotFollowing, CauseKind::Blocked], held_fast),
    parking(52, "deadman released while parking", NO_CAUSE, released_parking),
    parking(52, "link lost while parking", NO_CAUSE, link_lost_parking),
];

fn sensed_force(at: &Conditions<'_>, force: f64, criterion: Criterion) -> Injection {
    Injection::new([at.fault(Target::Link, FaultKind::SensedForce(force))], criterion)
}

/// Criterion of a rejected wrench, which counts as absent: reflection ends as after a loss of the link (hazard 34).
fn refused(at: &Conditions<'_>) -> Criterion {
    Criterion::ReflectionOff(at.limit_of(34))
}

fn not_finite(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let force = random.one_of(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]).copied();
    sensed_force(at, force.unwrap_or(f64::NAN), refused(at))
}

/// Reports a wrench above 1e5 N, which is rejected as a measurement.
fn too_large(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let exponent = random.within(5.1, 300.0);
    sensed_force(at, 10_f64.powf(exponent), refused(at))
}

/// Reports a large valid wrench, whose torque is limited in size and slew.
fn large(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let force = random.within(-400.0, 400.0);
    sensed_force(at, force, Criterion::GoesOn)
}

fn link(at: &Conditions<'_>, fault: LinkFault) -> Injection {
    let fault = at.fault(Target::Link, FaultKind::Link(fault));
    Injection::new([fault], Criterion::ReflectionOff(at.limit()))
}

/// Makes the far side answer another node; rejected messages count as absent.
fn answers_another(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let fault = at.fault(Target::Link, FaultKind::Link(LinkFault::Foreign));
    Injection::new([fault], refused(at))
}

/// Interrupts the link for less than the maximum age of a wrench.
fn link_briefly_lost(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let duration = random.duration(0.001, 0.010);
    let fault = if random.coin() { LinkFault::Lost } else { LinkFault::Frozen };
    let fault = at.fault_after(Duration::ZERO, Target::Link, FaultKind::Link(fault));
    Injection::new([Entry::Fault(fault.lasting(duration))], Criterion::GoesOn)
}

/// Moves the grip too fast. The onset is the first of two cycles above 1 m/s, since the watch needs two. The speed of the
/// watch, from counts, may be below the limit for one cycle more.
fn too_fast(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let duration_s = seconds(random.duration(0.08, 0.1));
    // This distance suffices with the heaviest grip.
    let y = if random.coin() { 0.2 } else { -0.2 };
    let movement = Move::new(at.onset_s(), duration_s, [0.0, y, 0.0]);
    let injection =
        Injection::new([Entry::Move(movement)], Criterion::Stop(at.limit() + at.cycles(1)));
    Injection { onset_speed: Some(1.0), ..injection }.observed_for(Duration::from_millis(300))
}

/// Releases the deadman: the command is zero in the next cycle, and reflection ends in time.
fn deadman_released(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let released = at.switch(Duration::ZERO, Switch::deadman, false);
    Injection::new([released], Criterion::Disengaged(at.limit(), MayStop::No))
}

/// Disconnects the switch box: reflection ends after three missed TPDOs, before the heartbeat time expires.
fn switch_box_unplugged(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let within = at.limit_of(2) + at.cycles(2);
    let unplugged = FaultKind::Disconnection(Disconnection::Unplugged);
    let criterion = if Situation::ENGAGED.contains(&at.situation) {
        Criterion::Disengaged(Duration::from_millis(40), MayStop::Yes)
    } else {
        Criterion::Stop(within)
    };
    Injection::new([at.fault(Target::SwitchBox, unplugged)], criterion)
        .observed_for(within + Duration::from_millis(150))
}

/// Maximum time of the ramp of gravity compensation to zero after disarming.
const RAMP_DOWN: Duration = Duration::from_millis(50);

fn disarmed(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let request = Console::new(at.onset_s(), ConsoleRequest::Disarm);
    let criterion = Criterion::ZeroTorque(RAMP_DOWN + at.cycles(2));
    Injection::new([Entry::Console(request)], criterion)
}

/// Takes the grip of an arm that moves itself, and holds it fast: the joints are blocked, or off their path, while it moves on.
fn held_fast(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let within = Duration::from_secs(2);
    let held = Entry::Hold(Hold::new(at.onset_s(), true));
    Injection::new([held], Criterion::ReflectionOff(within))
        .observed_for(within + Duration::from_millis(500))
}

/// Releases the deadman of an arm that moves itself: it stays, and nothing stops.
fn released_parking(_: &mut Random, at: &Conditions<'_>) -> Injection {
    Injection::new([at.switch(Duration::ZERO, Switch::deadman, false)], Criterion::GoesOn)
        .observed_for(Duration::from_secs(2))
}

/// Loses the link of an arm that moves itself, which commands and feels nothing.
fn link_lost_parking(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let lost = at.fault(Target::Link, FaultKind::Link(LinkFault::Lost));
    Injection::new([lost], Criterion::GoesOn)
}

/// Makes the deadman's contacts disagree; the switch box reports it after 10 ms.
fn deadman_stuck(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let is_a = random.coin();
    let input = if is_a { Input::DeadmanA } else { Input::DeadmanB };
    let is_low = is_a == at.situation.is_pressed();
    let stuck = if is_low { ContactFault::StuckLow } else { ContactFault::StuckHigh };
    let fault = at.fault(Target::SwitchBox, FaultKind::Contact(input, stuck));
    let criterion = Criterion::Stop(at.limit() + Duration::from_millis(10));
    Injection::new([fault], criterion).observed_for(Duration::from_millis(220))
}

fn bounces(at: &Conditions<'_>, after: Duration, input: Input, duration: Duration) -> Entry {
    let bouncing = FaultKind::Contact(input, ContactFault::Bouncing);
    Entry::Fault(at.fault_after(after, Target::SwitchBox, bouncing).lasting(duration))
}

/// Makes the pressed deadman bounce: the node may disengage, but must not stop or engage.
fn deadman_bounces(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let input = if random.coin() { Input::DeadmanA } else { Input::DeadmanB };
    let duration = random.duration(0.002, 0.040);
    Injection::new([bounces(at, Duration::ZERO, input, duration)], Criterion::GoesOn)
}

/// Function that returns the entry which closes or opens a switch at a time in s.
type SetSwitch = fn(f64, bool) -> Switch;

/// Presses each button once, with bouncing contacts at both edges.
fn buttons_bounce(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let buttons: [(SetSwitch, Input); 2] =
        [(Switch::reflection, Input::Reflection), (Switch::reference, Input::Reference)];
    let mut entries = Vec::new();
    for (millis, is_pressed) in [(0, true), (60, false)] {
        for (switch, input) in buttons {
            let after = Duration::from_millis(millis);
            entries.push(at.switch(after, switch, is_pressed));
            entries.push(bounces(at, after, input, random.duration(0.005, 0.020)));
        }
    }
    Injection::new(entries, Criterion::GoesOn)
}

/// Interrupts the switch box for less than its heartbeat time with the deadman pressed. This counts as a release; only a new
/// press may engage.
fn silent_while_closed(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let switch = if random.coin() { Switch::reflection } else { Switch::reference };
    let closed = at.switch(Duration::ZERO, switch, true);
    let lost = FaultKind::Frames(FrameFault::on_service(Service::Tpdo(1), Effect::Drop));
    let silent = at.fault_after(Duration::from_millis(30), Target::SwitchBox, lost);
    let silent = silent.lasting(random.duration(0.025, 0.060));
    let criterion = Criterion::Disengaged(Duration::from_millis(75), MayStop::No);
    Injection::new([closed, Entry::Fault(silent)], criterion)
}

/// Presses the deadman for less than the settling time of 25 ms: the node must not engage.
fn deadman_touched(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let pressed = at.switch(Duration::ZERO, Switch::deadman, true);
    let span = Duration::from_micros(1_000 + random.below(21_000));
    Injection::new([pressed, at.switch(span, Switch::deadman, false)], Criterion::GoesOn)
}

/// Presses the deadman with bouncing contacts: the node may engage 25 ms after the last bounce, not after the first.
fn deadman_bounces_when_pressed(random: &mut Random, at: &Conditions<'_>) -> Injection {
    let mut injection = deadman_bounces(random, at);
    injection.entries.insert(0, at.switch(Duration::ZERO, Switch::deadman, true));
    injection
}

fn reference_pressed(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let pressed = at.switch(Duration::ZERO, Switch::reference, true);
    let released = at.switch(Duration::from_millis(60), Switch::reference, false);
    Injection::new([pressed, released], Criterion::GoesOn)
}

fn reflection_switched(_: &mut Random, at: &Conditions<'_>) -> Injection {
    let presses = [(0, true), (40, false), (80, true), (120, false)];
    let presses = presses.map(|(millis, is_pressed)| {
        at.switch(Duration::from_millis(millis), Switch::reflection, is_pressed)
    });
    Injection::new(presses, Criterion::GoesOn)
}
