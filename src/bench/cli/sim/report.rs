//! State of each simulated drive, as a table or as one JSON object per line.

use canopen::frame::Channel;
use canopen::{error_codes, nmt};
use canopen_tools::object_text::mode_of_operation;
use config::{Config, JointParameters};
use controller::arm::JointKind;
use sim::drive_view::{Axis, DriveView, Report};
use units::time::Instant;

/// Returns the time, a heading and a row for each drive.
pub(super) fn text(config: &Config, report: &Report) -> String {
    let mut text = format!("{:.3} s after the start\n{}", seconds(report), columns());
    for (joint, axis) in config.joints.iter().zip(&report.axes) {
        text.push('\n');
        text.push_str(&row(config, joint, axis));
    }
    text
}

fn columns() -> String {
    format!(
        "{:<12} {:<10} {:>4} {:<15} {:<22} {:<27} {:>9} {:>9} {:>11} {:>6} {:>11} {:>12} {}",
        "joint",
        "bus",
        "node",
        "NMT",
        "state",
        "mode",
        "demand N·m",
        "actual N·m",
        "counts",
        "°C",
        "joint pos",
        "joint torque",
        "last error",
    )
}

fn row(config: &Config, joint: &JointParameters, axis: &Axis) -> String {
    let Axis { view, position, torque } = axis;
    let (length, force) = match joint.plant.link.kind {
        JointKind::Revolute => ("rad", "N·m"),
        JointKind::Prismatic => ("m", "N"),
    };
    format!(
        "{:<12} {:<10} {:>4} {:<15} {:<22} {:<27} {:>+9.4} {:>+9.4} {:>11} {:>6.1} {:>11} {:>12} {}",
        joint.name,
        bus(config, view),
        view.node.raw(),
        nmt::description(view.nmt),
        view.state.description(),
        mode_of_operation(view.mode),
        view.demand_torque,
        view.actual_torque,
        view.position_counts,
        view.temperature,
        format!("{position:+.4} {length}"),
        format!("{torque:+.3} {force}"),
        last_error(view.error),
    )
}

/// Returns the report as one JSON object.
pub(super) fn json(config: &Config, report: &Report) -> serde_json::Value {
    let pairs = (1..).zip(config.joints.iter().zip(&report.axes));
    let drives = pairs.map(|(number, (joint, axis))| drive(config, number, joint, axis));
    serde_json::json!({ "t_s": seconds(report), "drives": drives.collect::<Vec<_>>() })
}

fn drive(config: &Config, number: u8, joint: &JointParameters, axis: &Axis) -> serde_json::Value {
    let Axis { view, position, torque } = axis;
    let mut drive = serde_json::json!({
        "joint": number,
        "name": joint.name,
        "bus": bus(config, view),
        "node": view.node.raw(),
        "nmt": nmt::description(view.nmt),
        "state": view.state.description(),
        "mode": view.mode,
        "mode_name": mode_of_operation(view.mode),
        "torque_demanded_nm": view.demand_torque,
        "torque_actual_nm": view.actual_torque,
        "position_counts": view.position_counts,
        "temperature_c": view.temperature,
        "last_error": view.error,
        "last_error_name": last_error_name(view.error),
    });
    let [position_key, torque_key] = match joint.plant.link.kind {
        JointKind::Revolute => ["joint_position_rad", "joint_torque_nm"],
        JointKind::Prismatic => ["joint_position_m", "joint_force_n"],
    };
    if let Some(object) = drive.as_object_mut() {
        object.insert(position_key.to_owned(), (*position).into());
        object.insert(torque_key.to_owned(), (*torque).into());
    }
    drive
}

fn seconds(report: &Report) -> f64 {
    report.at.since(Instant::ZERO).as_secs_f64()
}

fn bus<'c>(config: &'c Config, view: &DriveView) -> &'c str {
    let Channel(place) = view.channel;
    config.buses.get(usize::from(place)).map_or("?", |bus| bus.name.as_str())
}

fn last_error(code: u16) -> String {
    if code == 0 {
        "none".to_owned()
    } else {
        format!("{code:04X}h {}", error_codes::description(code))
    }
}

/// Returns the name of the last error, `None` without one.
fn last_error_name(code: u16) -> Option<&'static str> {
    (code != 0).then(|| error_codes::description(code))
}
