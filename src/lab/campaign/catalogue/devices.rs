//! Drives and switch box: lost, restarted, broken, or sensing what is not so.

use std::time::Duration;

use crate::campaign::draw::Draw;
use crate::campaign::injection::Expectation;
use crate::campaign::injection::Injection;
use crate::campaign::injection::Place;
use crate::campaign::kind::Kind;
use crate::campaign::kind::engaged;
use crate::campaign::kind::in_contact;
use crate::campaign::kind::kind;
use canopen::error_codes;
use canopen::layout::Service;
use canopen::object::Object;
use node::cause::Kind as Cause;
use units::numbering::Joint;

pub(super) const KINDS: &[Kind] = &[
    kind(1, "drive unplugged", &[Cause::SamplesMissing], |draw, at| lost(draw, at, "unplug")),
    kind(1, "wire cut", &[Cause::SamplesMissing], |draw, at| lost(draw, at, "wire_cut")),
    kind(1, "drive bus-off", &[Cause::SamplesMissing], |draw, at| lost(draw, at, "bus_off")),
    kind(2, "drive heartbeat lost", &[Cause::HeartbeatLost], heartbeat_lost),
    kind(2, "switch box heartbeat lost", &[Cause::HeartbeatLost], switches_silent),
    kind(8, "drive heartbeat says stopped", &[Cause::LeftOperational], heartbeat_stopped),
    kind(7, "emergency", &[Cause::Emergency], emergency),
    kind(7, "emergency of the switch box", &[Cause::Emergency], emergency_of_switches),
    kind(8, "drive fault", &[Cause::Emergency, Cause::DriveLeft], fault),
    kind(8, "drive fault, untold", &[Cause::DriveLeft], quiet_fault),
    kind(8, "safe torque off", &[Cause::DriveLeft, Cause::Emergency], sto),
    kind(9, "drive reboots", &[Cause::Rebooted], reboot),
    kind(9, "switch box reboots", &[Cause::Rebooted], reboot_of_switches),
    engaged(10, "torque actual wrong", &[Cause::TorqueDiffers], torque_scaled),
    kind(12, "encoder jumps", &[Cause::PositionJumped], encoder_jump),
    engaged(5, "encoder frozen", &[Cause::PositionFrozen], encoder_frozen),
    in_contact(5, "encoder frozen in motion", &[Cause::PositionFrozen], frozen_in_motion),
    kind(13, "several drives unplugged", &[Cause::SamplesMissing], several_lost),
];

/// A drive that breaks: the other five in two cycles.
fn drive_fault(at: &Place<'_>) -> Expectation {
    Expectation::Stop(at.config.period.saturating_mul(2))
}

/// What is seen by samples that do not come: five cycles.
fn unseen(at: &Place<'_>) -> Expectation {
    Expectation::Stop(at.config.period.saturating_mul(5))
}

fn lost(draw: &mut Draw, at: &Place<'_>, how: &str) -> Injection {
    let joint = draw.joint();
    Injection::scripted(at.fault(&format!("kind = \"{how}\"; joint = {joint}")), unseen(at))
}

fn several_lost(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joints = [draw.joint(), draw.joint(), draw.joint()];
    let all = joints.map(|joint| at.fault(&format!("kind = \"unplug\"; joint = {joint}")));
    Injection::scripted(all.concat(), unseen(at))
}

/// As long as the configuration says, and the cycle in which it is seen.
fn heartbeat_lost(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint();
    silent(at, &format!("kind = \"heartbeat_stop\"; joint = {joint}"))
}

/// Heartbeats, before the node-id is added.
const HEARTBEAT: u16 = 0x700;

/// One heartbeat that says stopped, or pre-operational, as if of a drive; the drive goes on.
fn heartbeat_stopped(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint().entry(&at.config.joints);
    let (bus, node) = (joint.channel.0, joint.node.raw());
    let cob_id = HEARTBEAT + u16::from(node);
    let state = if draw.is_heads() { "04" } else { "7F" };
    let keys = format!(
        "kind = \"foreign_frame\"; cob_id = 0x{cob_id:03X}; payload = \"{state}\"; bus = {bus}"
    );
    Injection::scripted(at.fault(&keys), drive_fault(at))
}

fn switches_silent(_: &mut Draw, at: &Place<'_>) -> Injection {
    silent(at, "kind = \"heartbeat_stop\"; device = \"switches\"")
}

fn silent(at: &Place<'_>, keys: &str) -> Injection {
    let within = at.config.safety.drive_lost + at.cycles(2);
    let injection = Injection::scripted(at.fault(keys), Expectation::Stop(within));
    injection.watched_for(within + Duration::from_millis(150))
}

/// One of those that a drive may tell.
fn error_code(draw: &mut Draw) -> u16 {
    draw.among(&error_codes::OF_DRIVES).copied().unwrap_or(error_codes::OVER_CURRENT)
}

fn emergency(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let (joint, code) = (draw.joint(), error_code(draw));
    let keys = format!("kind = \"emergency\"; joint = {joint}; code = 0x{code:04X}; register = 1");
    Injection::scripted(at.fault(&keys), drive_fault(at))
}

fn emergency_of_switches(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let code = error_code(draw);
    let keys =
        format!("kind = \"emergency\"; device = \"switches\"; code = 0x{code:04X}; register = 1");
    Injection::scripted(at.fault(&keys), drive_fault(at))
}

fn fault(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let (joint, code) = (draw.joint(), error_code(draw));
    let keys = format!("kind = \"fault\"; joint = {joint}; code = 0x{code:04X}");
    Injection::scripted(at.fault(&keys), drive_fault(at))
}

/// How long a drive may keep a changed statusword to itself, after it has told another (1800h:3).
fn silence(at: &Place<'_>, joint: Joint) -> Duration {
    let plans = at.config.node_plans();
    let pdos = plans.get(joint.index()).map(|(_, plan)| &*plan.pdos);
    let mut services = pdos.unwrap_or_default().iter().filter_map(|pdo| pdo.service.as_ref());
    let is_status = |service: &&Service| {
        service.mapping.iter().any(|mapped| mapped.object == Object::STATUSWORD)
    };
    let inhibit = services.find(is_status).and_then(|service| service.inhibit_100us);
    Duration::from_micros(100 * u64::from(inhibit.unwrap_or(0)))
}

/// A statusword alone tells it.
fn quiet_fault(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = draw.joint();
    let keys = format!("kind = \"fault\"; joint = {joint}");
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(2) + silence(at, joint)))
}

fn sto(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let keys = format!("kind = \"sto\"; joint = {}", draw.joint());
    Injection::scripted(at.fault(&keys), drive_fault(at))
}

fn reboot(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let keys = format!("kind = \"reset\"; joint = {}", draw.joint());
    Injection::scripted(at.fault(&keys), drive_fault(at))
}

fn reboot_of_switches(_: &mut Draw, at: &Place<'_>) -> Injection {
    Injection::scripted(at.fault("kind = \"reset\"; device = \"switches\""), drive_fault(at))
}

/// What only a joint that pushes shows: demanded of those that carry more than a little of the arm.
fn where_pushed(at: &Place<'_>, joint: Joint, within: Duration) -> Expectation {
    if at.weight(joint) > CARRIES {
        Expectation::Stop(within)
    } else {
        Expectation::Either("seen only where the joint is pushed enough")
    }
}

/// In ‰ of the most a joint may exert.
const CARRIES: f64 = 100.0;

/// Shoulder joints carry the arm, so a wrong scale shows.
fn torque_scaled(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let joint = if draw.is_heads() { Joint::of::<3>() } else { Joint::of::<2>() };
    let scale = draw.within(-10.0, -6.0);
    let keys = format!("kind = \"torque_actual_scale\"; joint = {joint}; scale = {scale:.2}");
    let within = Duration::from_millis(55).max(at.cycles(216));
    Injection::scripted(at.fault(&keys), where_pushed(at, joint, within))
        .watched_for(Duration::from_millis(600))
}

fn encoder_jump(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let sign = if draw.is_heads() { 1.0 } else { -1.0 };
    let (joint, by) = (draw.joint(), sign * draw.within(0.2, 3.0));
    let keys = format!("kind = \"encoder_jump\"; joint = {joint}; by_rad = {by:.4}");
    Injection::scripted(at.fault(&keys), Expectation::Stop(at.cycles(3)))
}

fn encoder_frozen(draw: &mut Draw, at: &Place<'_>) -> Injection {
    let keys = format!("kind = \"encoder_frozen\"; joint = {}", draw.joint());
    let why = "seen only while it pushes and a neighbour moves";
    Injection::scripted(at.fault(&keys), Expectation::Either(why))
        .watched_for(Duration::from_millis(800))
}

/// The elevation, which carries the arm, while the hand moves it and its neighbour.
fn frozen_in_motion(_: &mut Draw, at: &Place<'_>) -> Injection {
    let at_s = at.onset.as_secs_f64();
    let moved =
        format!("[[move]]\nat_s = {at_s:.6}\nduration_s = 1.0\nto_m = [0.1, 0.0, -0.05]\n\n");
    let elevation = Joint::of::<2>();
    let keys = format!("kind = \"encoder_frozen\"; joint = {elevation}");
    let frozen = at.fault_after(Duration::from_millis(100), &keys);
    let expectation = where_pushed(at, elevation, Duration::from_millis(700));
    Injection::scripted(moved + &frozen, expectation).watched_for(Duration::from_millis(900))
}
