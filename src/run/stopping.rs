//! Timers that stop each drive without its master, and planned values that a data sheet excludes: as text and as JSON.

use config::{Caution, Config, JointParameters, Stopping};

/// Returns one line for each joint, and one for each planned value beyond the limits of a data sheet.
pub fn lines(config: &Config) -> Vec<String> {
    let cap = config.force_cap();
    let mut lines = Vec::new();
    for (joint, stopping) in config.joints.iter().zip(config.stopping()) {
        let force = stopping.reaction_time().map_or(0.0, |time| cap.max_force(time));
        let name = &joint.name;
        lines.push(format!("stops {name:16} by {stopping}: at most {force:.1} N at the grip"));
    }
    lines.extend(cautions(config));
    lines
}

/// Returns one line for each planned value beyond the limits of a data sheet.
pub fn cautions(config: &Config) -> Vec<String> {
    config.cautions().iter().map(|caution| format!("value {caution}")).collect()
}

/// Returns the timers of each joint, with the sum of forces that follows.
pub fn json(config: &Config) -> serde_json::Value {
    let cap = config.force_cap();
    let one = |(joint, stopping): (&JointParameters, Stopping)| {
        serde_json::json!({
            "joint": joint.name,
            "stops_by": stopping.to_string(),
            "max_force_n": stopping.reaction_time().map(|time| cap.max_force(time)),
        })
    };
    config.joints.iter().zip(config.stopping()).map(one).collect()
}

/// Returns the planned values beyond the limits of a data sheet.
pub fn cautions_json(config: &Config) -> serde_json::Value {
    config.cautions().iter().map(Caution::to_string).collect()
}
