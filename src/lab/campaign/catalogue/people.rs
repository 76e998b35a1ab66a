//! The operator and the commanded side.

use std::time::Duration;

use crate::campaign::draw::Draw;
use crate::campaign::injection::Expectation;
use crate::campaign::injection::Injection;
use crate::campaign::injection::MayStop;
use crate::campaign::injection::Place;
use crate::campaign::kind::Kind;
use crate::campaign::kind::NO_CAUSE;
use crate::campaign::kind::armed;
use crate::campaign::kind::engaged;
use crate::campaign::kind::in_contact;
use crate::campaign::kind::kind;
use node::cause::Kind as Cause;

pub(super) const KINDS: &[Kind] = &[
    in_contact(11, "hand too fast", &[Cause::GripOverspeed], too_fast),
    engaged(33, "wrench no number", &[Cause::LinkLost], no_number),
    engaged(33, "wrench too large", &[Cause::LinkLost], too_large),
    engaged(33, "wrench large, but may be", NO_CAUSE, large),
    engaged(34, "link lost", &[Cause::LinkLost], |_, at| link(at, "link_loss")),
    engaged(35, "link frozen", &[Cause::LinkLost], |_, at| link(at, "link_frozen")),
    engaged(34, "link lost for a moment", NO_CAUSE, link_blinks),
    engaged(38, "deadman released", NO_CAUSE, deadman_released),
    kind(
        38,
        "switch box unplugged",
        &[Cause::HeartbeatLost, Cause::StatusMissing],
        switches_unplugged,
    ),
    kind(38, "disarmed", NO_CAUSE, disarmed),
    kind(39, "deadman channel stuck", &[Cause::DeadmanDisagrees], deadman_stuck),
    kind(39, "deadman bounces", NO_CAUSE, deadman_bounces),
    armed(39, "deadman touched", NO_CAUSE, deadman_touched),
    armed(39, "deadman bounces when pressed", NO_CAUSE, deadman_bounces_when_pressed),
    engaged(39, "reflection and reference bounce", NO_CAUSE, buttons_bounce),
    engaged(39, "switch box silent, a switch closed", NO_CAUSE, silent_while_closed),
    engaged(40, "reference pressed in motion", NO_CAUSE, reference_pressed),
    engaged(41, "reflection switched on", NO_CAUSE, reflection_switched),
];

fn senses(force: f64, expectation: Expectation) -> Injection {
    Injection { senses: Some(force), ..Injection::scripted(String::new(), expectation) }
}

/// What is refused is no new wrench: reflection ends as if the link were lost.
const REFUSED: Expectation = Expectation::LetGo(Duration::from_millis(70));

fn no_number(draw: &mut Draw, _: &Place<'_>) -> Injection {
    let force = draw.among(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]).copied();
    senses(force.unwrap_or(f64::NAN), REFUSED)
}

/// More than 1e5 N is no reading.
fn too_large(draw: &mut Draw, _: &Place<'_>) -> Injection {
    let exponent = draw.within(5.1, 300.0);
    senses(10_f64.powf(exponent), REFUSED)
}

/// Cut off at the cap, and grows as any torque may.
fn large(draw: &mut Draw, _: &Place<'_>) -> Injection {
    let force = draw.within(-400.0, 400.0);
    senses(force, Expectation::GoOn)
}

fn link(at: &Place<'_>, how: &str) -> Injection {
    let expectation = Expectation::LetGo(Duration::from_millis(70));
    Injection::scripted(at.fault(&format!("kind = \"{how}\"")), expectation)
}

/// Shorter than any age that matters.
fn link_blinks(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let seconds = draw.within(0.001, 0.010);
    let how = if draw.is_heads() { "link_loss" } else { "link_frozen" };
    Injection::scripted(
        at.fault(&format!("kind = \"{how}\"; for_s = {seconds:.6}")),
        Expectation::GoOn,
    )
}

/// From when the grip is faster than 1 m/s.
fn too_fast(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let (at_s, seconds) = (at.onset.as_secs_f64(), draw.within(0.08, 0.1));
    let y = if draw.is_heads() { 0.1 } else { -0.1 };
    let entries = format!(
        "[[move]]\nat_s = {at_s:.6}\nduration_s = {seconds:.6}\nto_m = [0.0, {y}, 0.0]\n\n"
    );
    let injection = Injection::scripted(entries, Expectation::Stop(at.cycles(5)));
    Injection { onset_speed: Some(1.0), ..injection }.watched_for(Duration::from_millis(300))
}

fn switch(at: &Place<'_>, after: Duration, keys: &str) -> String {
    let at_s = (at.onset + after).as_secs_f64();
    format!("[[switch]]\nat_s = {at_s:.6}\n{keys}\n\n")
}

/// The command is zero in the next cycle, and nothing is felt after 20 ms.
fn deadman_released(_: &mut Draw, at: &Place<'_>) -> Injection {
    let entries = switch(at, Duration::ZERO, "deadman = false");
    Injection::scripted(entries, Expectation::Disengage(Duration::from_millis(20), MayStop::No))
}

/// Its heartbeat is missed after a while; what is felt ends as soon as three of its words are.
fn switches_unplugged(_: &mut Draw, at: &Place<'_>) -> Injection {
    let within = at.config.safety.drive_lost + at.cycles(2);
    let entries = at.fault("kind = \"unplug\"; device = \"switches\"");
    let expectation = if at.situation.is_engaged() {
        Expectation::Disengage(Duration::from_millis(40), MayStop::Yes)
    } else {
        Expectation::Stop(within)
    };
    Injection::scripted(entries, expectation).watched_for(within + Duration::from_millis(150))
}

/// The weight of the arm may be laid down by a ramp.
const LAYS_DOWN: Duration = Duration::from_millis(50);

fn disarmed(_: &mut Draw, at: &Place<'_>) -> Injection {
    let at_s = at.onset.as_secs_f64();
    let entries = format!("[[console]]\nat_s = {at_s:.6}\nrequest = \"disarm\"\n");
    Injection::scripted(entries, Expectation::Zero(LAYS_DOWN + at.cycles(2)))
}

/// One channel says what the other does not.
fn deadman_stuck(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let is_a = draw.is_heads();
    let input = if is_a { "deadman_a" } else { "deadman_b" };
    let level = if is_a == at.situation.is_engaged() { "low" } else { "high" };
    let keys = format!("kind = \"switch_stuck\"; switch = \"{input}\"; level = \"{level}\"");
    let expectation = Expectation::Stop(Duration::from_millis(60));
    Injection::scripted(at.fault(&keys), expectation).watched_for(Duration::from_millis(220))
}

/// It may disengage, which is no reason to stop, and must not engage.
fn deadman_bounces(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let input = if draw.is_heads() { "deadman_a" } else { "deadman_b" };
    let seconds = draw.within(0.002, 0.040);
    let keys = format!("kind = \"switch_bounce\"; switch = \"{input}\"; for_s = {seconds:.6}");
    Injection::scripted(at.fault(&keys), Expectation::GoOn)
}

/// Each is pressed once, and its contacts bounce at both edges.
fn buttons_bounce(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let mut entries = String::new();
    for (millis, level) in [(0, true), (60, false)] {
        for switch_name in ["reflection", "reference"] {
            let after = Duration::from_millis(millis);
            entries.push_str(&switch(at, after, &format!("{switch_name} = {level}")));
            let seconds = draw.within(0.005, 0.020);
            let keys = format!(
                "kind = \"switch_bounce\"; switch = \"{switch_name}\"; for_s = {seconds:.6}"
            );
            entries.push_str(&at.fault_after(after, &keys));
        }
    }
    Injection::scripted(entries, Expectation::GoOn)
}

/// Its silence opens the deadman, which only a new press closes; it comes back long before its heartbeat is missed.
fn silent_while_closed(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let name = if draw.is_heads() { "reflection" } else { "reference" };
    let closed = switch(at, Duration::ZERO, &format!("{name} = true"));
    let seconds = draw.within(0.025, 0.060);
    let keys =
        format!("kind = \"drop\"; device = \"switches\"; frame = \"tpdo1\"; for_s = {seconds:.6}");
    let silent = at.fault_after(Duration::from_millis(30), &keys);
    let expectation = Expectation::Disengage(Duration::from_millis(75), MayStop::No);
    Injection::scripted(closed + &silent, expectation)
}

/// Closed for less than the 25 ms contacts settle in: nothing engages.
fn deadman_touched(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let pressed = switch(at, Duration::ZERO, "deadman = true");
    let span = Duration::from_micros(1_000 + draw.below(21_000));
    Injection::scripted(pressed + &switch(at, span, "deadman = false"), Expectation::GoOn)
}

/// It engages 25 ms after the last bounce, not after the first.
fn deadman_bounces_when_pressed(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let bounces = deadman_bounces(draw, at);
    let entries = switch(at, Duration::ZERO, "deadman = true") + &bounces.entries;
    Injection { entries, ..bounces }
}

fn reference_pressed(_: &mut Draw, at: &Place<'_>) -> Injection {
    let pressed = switch(at, Duration::ZERO, "reference = true");
    let released = switch(at, Duration::from_millis(60), "reference = false");
    Injection::scripted(pressed + &released, Expectation::GoOn)
}

fn reflection_switched(_: &mut Draw, at: &Place<'_>) -> Injection {
    let mut entries = String::new();
    for (millis, level) in [(0, true), (40, false), (80, true), (120, false)] {
        let keys = format!("reflection = {level}");
        entries.push_str(&switch(at, Duration::from_millis(millis), &keys));
    }
    Injection::scripted(entries, Expectation::GoOn)
}
