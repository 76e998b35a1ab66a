//! Zero of each joint, as `frhc check` reports it: where it comes from, and what its tolerance costs at the grip.

use config::zero::ZeroSource;
use config::{Config, JointParameters};

/// Force at the grip, in N, above which the tolerance of a zero is a warning: twice that to which contact is judged.
const MAX_COST_N: f64 = 0.3;

/// Returns one line for each joint whose zero the cradle sets, and one for those that nothing verifies.
pub(super) fn lines(config: &Config) -> Vec<String> {
    let costs = config.zero_costs();
    let joints = config.joints.iter().zip(costs);
    let mut lines: Vec<_> = joints.filter_map(|(joint, cost)| of_cradle(joint, cost)).collect();
    let unverified: Vec<_> = unverified(config).map(|joint| joint.name.as_str()).collect();
    if !unverified.is_empty() {
        lines.push(format!(
            "zero  warning   {}: absolute without rest_deg (rest_m): a slipped encoder would not be seen",
            unverified.join(", ")
        ));
    }
    lines
}

/// Returns the zeros as JSON, in the order of the joints.
pub(super) fn json(config: &Config) -> serde_json::Value {
    let costs = config.zero_costs();
    let joint = |(joint, cost): (&JointParameters, f64)| {
        serde_json::json!({
            "joint": joint.name,
            "zero": joint.zero.source.key(),
            "rest": joint.rest.map(|rest| rest.position()),
            "tolerance": joint.rest.map(|rest| rest.tolerance()),
            "cost_n": is_of_cradle(joint).then_some(cost),
        })
    };
    config.joints.iter().zip(costs).map(joint).collect()
}

/// Returns the joints that a slipped encoder would leave unseen.
fn unverified(config: &Config) -> impl Iterator<Item = &JointParameters> {
    let joints = config.joints.iter();
    joints.filter(|joint| joint.rest.is_none() && joint.zero.source.is_absolute())
}

/// Returns whether the zero is as precise as the cradle.
const fn is_of_cradle(joint: &JointParameters) -> bool {
    match joint.zero.source {
        ZeroSource::Absolute | ZeroSource::SingleTurn { .. } => false,
        ZeroSource::Rest | ZeroSource::Homing(_) => true,
    }
}

fn of_cradle(joint: &JointParameters, cost: f64) -> Option<String> {
    let rest = joint.rest.filter(|_| is_of_cradle(joint))?;
    let warning = if cost > MAX_COST_N { "warning   " } else { "" };
    let advice = if cost > MAX_COST_N { "; a smaller tolerance needs a better cradle" } else { "" };
    Some(format!(
        "zero  {warning}{}: {}, set at {rest}: off by that costs up to {cost:.2} N at the grip{advice}",
        joint.name,
        joint.zero.source.key()
    ))
}
