//! Timers that stop each drive without its master, and planned values outside the limits of an EDS, as text and JSON.

use canopen::fact::Fact;
use config::facts::Facts;
use config::{Caution, Config, HeldTorque, JointParameters, Stopping};

/// Returns one line for each joint, and one for each planned value outside the limits of its EDS.
pub fn lines(config: &Config) -> Vec<String> {
    let cap = config.force_cap();
    let mut lines = Vec::new();
    for (joint, stopping) in config.joints.iter().zip(config.stopping()) {
        let force = stopping.reaction_time().map_or(0.0, |time| cap.max_force(time));
        let name = &joint.name;
        let half = if cap.is_halved { ", half of what the timers allow" } else { "" };
        lines
            .push(format!("stops {name:16} by {stopping}: at most {force:.1} N at the grip{half}"));
    }
    for (joint, held) in config.joints.iter().zip(config.held_torques()) {
        let HeldTorque { seen_by, time } = held;
        let (name, millis) = (&joint.name, time.as_millis());
        lines.push(format!(
            "rpdos {name:16} that no longer arrive are seen within {millis} ms by {seen_by}"
        ));
    }
    lines.extend(facts(&config.facts()));
    for joint in &config.joints {
        if let Some(rest) = joint.rest {
            let name = &joint.name;
            lines.push(format!(
                "rest  {name:16} at {rest}, when armed for the first time after a boot"
            ));
        }
    }
    lines.extend(cautions(config));
    lines
}

/// Returns one line for each joint, with the facts that its drive verifies and those that are stated only.
pub fn facts(facts: &[Facts]) -> Vec<String> {
    facts.iter().map(|facts| format!("facts {:16} {facts}", facts.joint)).collect()
}

/// Returns the facts of each joint as JSON.
pub fn facts_json(facts: &[Facts]) -> serde_json::Value {
    let one = |facts: &Facts| {
        let stated = facts.stated_only().into_iter().map(Fact::key);
        serde_json::json!({
            "joint": facts.joint,
            "stated_only": stated.collect::<Vec<_>>(),
            "stated_torque_limit": facts.torque_limit.map(|limit| limit.to_string()),
        })
    };
    facts.iter().map(one).collect()
}

/// Returns one line for each planned value outside the limits of its EDS.
pub fn cautions(config: &Config) -> Vec<String> {
    config.cautions().iter().map(|caution| format!("value {caution}")).collect()
}

/// Returns the timers of each joint, with the resulting maximum sum of forces, as JSON.
pub fn json(config: &Config) -> serde_json::Value {
    let cap = config.force_cap();
    let one = |((joint, stopping), held): ((&JointParameters, Stopping), HeldTorque)| {
        serde_json::json!({
            "joint": joint.name,
            "stops_by": stopping.to_string(),
            "max_force_n": stopping.reaction_time().map(|time| cap.max_force(time)),
            "held_torque_seen_by": held.seen_by.to_string(),
            "held_torque_ms": held.time.as_secs_f64() * 1e3,
        })
    };
    let stopping = config.joints.iter().zip(config.stopping());
    stopping.zip(config.held_torques()).map(one).collect()
}

/// Returns the planned values outside the limits of their EDS, as JSON.
pub fn cautions_json(config: &Config) -> serde_json::Value {
    config.cautions().iter().map(Caution::to_string).collect()
}
