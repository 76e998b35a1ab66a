//! Frames of devices: lost, late, twice, changed, or another's.

use std::time::Duration;

use crate::campaign::draw::Draw;
use crate::campaign::injection::Expectation;
use crate::campaign::injection::Injection;
use crate::campaign::injection::Place;
use crate::campaign::kind::Kind;
use crate::campaign::kind::NO_CAUSE;
use crate::campaign::kind::kind;
use config::Layout;
use node::cause::Kind as Cause;
use units::numbering::Joint;

pub(super) const KINDS: &[Kind] = &[
    kind(3, "TPDO lost", &[Cause::SamplesMissing], |draw, at| of_tpdo(draw, at, "drop", "")),
    kind(3, "TPDOs lost now and then", LOSSES, tpdo_share),
    kind(3, "one TPDO lost", NO_CAUSE, one_tpdo),
    kind(3, "SYNC not heard", &[Cause::SamplesMissing], sync_lost),
    kind(3, "TPDO of another length", &[Cause::SamplesMissing], resized),
    kind(4, "TPDO late by less than 3 cycles", LOSSES, a_bit_late),
    kind(4, "TPDO late by more", LOSSES, late),
    kind(4, "TPDOs overtake each other", OUT_OF_ORDER, reordered),
    kind(4, "TPDOs grow old", &[Cause::SamplesOverdue], grow_old),
    kind(5, "TPDO frozen", &[Cause::PositionFrozen], frozen),
    kind(6, "TPDO twice", &[Cause::Duplicate], |draw, at| of_tpdo(draw, at, "duplicate", "")),
    kind(6, "two drives of one node-id", TWO_DRIVES, impersonated),
    kind(12, "TPDO corrupted", &[Cause::PositionJumped], corrupted),
    kind(13, "RPDO lost", &[Cause::Emergency, Cause::DriveLeft], rpdo_lost),
    kind(13, "one RPDO lost", NO_CAUSE, one_rpdo),
];

/// Two drives that answer by turns look like one whose position jumps, where the second is first in its window.
const TWO_DRIVES: &[Cause] = &[Cause::Duplicate, Cause::PositionJumped];

/// Samples that overtake each other leave windows empty; those that come at last may be more than were asked for.
const OUT_OF_ORDER: &[Cause] =
    &[Cause::SamplesMissing, Cause::SamplesRare, Cause::SamplesOverdue, Cause::Duplicate];

/// Samples that do not come, or not in time: three in a row, one in twenty, or more than ten overdue.
const LOSSES: &[Cause] = &[Cause::SamplesMissing, Cause::SamplesRare, Cause::SamplesOverdue];

/// What happens to every first TPDO of a drive: five cycles.
fn of_tpdo(draw: &mut Draw, at: &Place<'_>, how: &str, more: &str) -> Injection {
    let joint = draw.joint();
    let keys = format!("kind = \"{how}\"; joint = {joint}; frame = \"tpdo1\"{more}");
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(5)))
}

fn resized(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let bytes = draw.below(4);
    of_tpdo(draw, at, "resize", &format!("; bytes = {bytes}"))
}

/// More than 5 % within a second.
fn tpdo_share(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let (joint, share) = (draw.joint(), draw.within(0.1, 0.2));
    let keys = format!("kind = \"drop\"; joint = {joint}; frame = \"tpdo1\"; share = {share:.3}");
    let within = Duration::from_millis(1_100) + at.cycles(2);
    let injection = Injection::scripted(at.fault(&keys), Expectation::LetGo(within));
    injection.watched_for(within + Duration::from_millis(50))
}

fn one_tpdo(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint();
    let keys = format!("kind = \"drop\"; joint = {joint}; frame = \"tpdo1\"; count = 1");
    Injection::scripted(at.fault(&keys), Expectation::GoOn)
}

fn sync_lost(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let keys = format!("kind = \"drop\"; joint = {}; frame = \"sync\"", draw.joint());
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(5)))
}

/// In cycles, which a script tells in ms.
fn delayed(draw: &mut Draw, at: &Place<'_>, cycles: f64, more: &str) -> String {
    let millis = cycles * at.config.period.as_secs_f64() * 1e3;
    let joint = draw.joint();
    at.fault(&format!(
        "kind = \"delay\"; joint = {joint}; frame = \"tpdo1\"; delay_ms = {millis:.3}{more}"
    ))
}

fn a_bit_late(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let cycles = draw.within(0.2, 2.0);
    let why = "a constant lateness cannot be told from none";
    Injection::scripted(delayed(draw, at, cycles, ""), Expectation::Either(why))
}

fn late(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let cycles = draw.within(4.0, 20.0);
    Injection::scripted(delayed(draw, at, cycles, ""), Expectation::Stop(at.cycles(5)))
}

fn reordered(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let cycles = draw.within(0.5, 3.0);
    let more = "; share = 0.3; reorder = true";
    let why = "a late one fills the place it left";
    Injection::scripted(delayed(draw, at, cycles, more), Expectation::Either(why))
}

/// By a cycle more every 50 cycles, as behind a queue that grows, up to 16.
fn grow_old(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint();
    let step = at.cycles(50);
    let mut entries = String::new();
    for age in 1..=16 {
        let millis = at.cycles(age).as_secs_f64() * 1e3;
        let keys = format!(
            "kind = \"delay\"; joint = {joint}; frame = \"tpdo1\"; delay_ms = {millis:.3}; for_s = {:.6}",
            step.as_secs_f64()
        );
        entries.push_str(&at.fault_after(step * (age - 1), &keys));
    }
    // Forgiven at one in 250 cycles: more than ten are overdue when they are 14 cycles old.
    let within = at.cycles(14 * 50);
    let expectation = Expectation::Stop(within);
    Injection::scripted(entries, expectation).watched_for(within + Duration::from_millis(150))
}

fn frozen(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let why = "seen only while it pushes and a neighbour moves";
    let injection = of_tpdo(draw, at, "freeze", "");
    Injection { expectation: Expectation::Either(why), ..injection }
        .watched_for(Duration::from_millis(800))
}

/// Two drives of one bus with one node-id: positions that are not near each other.
fn impersonated(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint();
    let channel = |joint: Joint| joint.entry(&at.config.joints).channel;
    let others: Vec<Joint> = Joint::ALL
        .into_iter()
        .filter(|by| *by != joint && channel(*by) == channel(joint))
        .collect();
    let by = draw.among(&others).copied().unwrap_or(joint);
    let keys = format!("kind = \"impersonate\"; joint = {joint}; by = {by}; frame = \"tpdo1\"");
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(5)))
}

/// A high bit of the position, whose place is the layout's.
fn corrupted(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint();
    let channel = joint.entry(&at.config.joints).channel;
    let bus = at.config.buses.get(usize::from(channel.0));
    let before = match bus.map(|bus| bus.layout) {
        Some(Layout::PerDrive) | None => 2,
        Some(Layout::Grouped) => 0,
    };
    let bit = 1_u64 << (20 + draw.below(11));
    let mask: String = bit.to_le_bytes().iter().take(4).map(|byte| format!("{byte:02X}")).collect();
    let xor = format!("{}{mask}", "00".repeat(before));
    let keys = format!("kind = \"corrupt\"; joint = {joint}; frame = \"tpdo1\"; xor = \"{xor}\"");
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(3)))
}

/// The drive's own timer, its emergency, and the others' next cycle.
fn rpdo_lost(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let keys = format!("kind = \"drop\"; joint = {}; frame = \"rpdo1\"", draw.joint());
    let timer = Duration::from_millis(u64::from(at.config.safety.rpdo_timer_ms));
    Injection::scripted(at.fault(&keys), Expectation::Stop(timer + at.cycles(2)))
}

fn one_rpdo(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let keys = format!("kind = \"drop\"; joint = {}; frame = \"rpdo1\"; count = 1", draw.joint());
    Injection::scripted(at.fault(&keys), Expectation::GoOn)
}
