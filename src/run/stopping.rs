//! Timers that stop each drive without its master, and planned values outside the limits of an EDS, as text and JSON.

use crate::rows;
use canopen::fact::Fact;
use config::facts::Facts;
use config::{Caution, Config, HeldTorque, JointParameters, Stopping};

/// Returns what stops each joint's drive, what its drive verifies, and its rest, with one line for equal joints; and one for
/// each planned value outside the limits of its EDS.
pub fn lines(config: &Config) -> Vec<String> {
    let mut lines =
        rows::folded("stops", of_joints(config, config.stopping(), |it| stops(config, &it)));
    lines.extend(rows::folded(
        "rpdos",
        of_joints(config, config.held_torques(), |held| {
            let HeldTorque { seen_by, time } = held;
            format!("that no longer arrive are seen within {} ms by {seen_by}", time.as_millis())
        }),
    ));
    lines.extend(facts(&config.facts()));
    let rests = config.joints.iter().filter_map(|joint| Some((joint.name.as_str(), joint.rest?)));
    lines.extend(rows::folded(
        "rest ",
        rests.map(|(name, rest)| {
            (name, format!("at {rest}, when armed for the first time after a boot"))
        }),
    ));
    lines.extend(cautions(config));
    lines
}

/// Returns the name of each joint with the text of its value.
fn of_joints<T>(
    config: &Config,
    values: impl IntoIterator<Item = T>,
    text: impl Fn(T) -> String,
) -> impl Iterator<Item = (&str, String)> {
    config.joints.iter().zip(values).map(move |(joint, value)| (joint.name.as_str(), text(value)))
}

/// Describes what stops a drive, and the force of the arm until then.
fn stops(config: &Config, stopping: &Stopping) -> String {
    let cap = config.force_cap();
    let force = stopping.reaction_time().map_or(0.0, |time| cap.max_force(time));
    let half = if cap.is_halved { ", half of what the timers allow" } else { "" };
    format!("by {stopping}: at most {force:.1} N at the grip{half}")
}

/// Returns the facts that the drives verify and those that are stated only, with one line for equal joints.
pub fn facts(facts: &[Facts]) -> Vec<String> {
    rows::folded("facts", facts.iter().map(|facts| (facts.joint.as_str(), facts.to_string())))
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
