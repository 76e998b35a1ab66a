//! Checks of the devices across sections: unique node-ids, identities that match the EDS, and writable objects for
//! all planned values. [`layouts`] checks their PDOs.

use std::collections::HashSet;

use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::value::HasPlace;
use crate::{files, layouts, plans, raw, value_limits};
use canopen::eds::{Eds, Finding, Gap};
use canopen::exchange::{self, Exchange};
use canopen::nameplate::HAS_CYCLIC_TORQUE;
use canopen::object::Object;
use canopen::plan::{Identity, NodePlan};
use canopen::setting;
use units::numbering::Joint;

/// Checks all devices. Returns the cyclic exchange, unless the layouts contradict each other.
pub(super) fn check(
    config: &Parameters,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<Exchange> {
    let mut taken = HashSet::new();
    for place in config.channels() {
        taken.insert((place, config.node_id.raw()));
    }
    let joints = Joint::ALL.into_iter().zip(&config.joints);
    for ((number, joint), raw) in joints.zip(raw.joint.all()) {
        if !taken.insert((joint.channel, joint.node.raw())) {
            problems.add(&raw.node_id, twice(config, joint));
        }
        identity(&raw.product_code, &joint.eds, &joint.identity, problems);
        let plan = plans::drive(config, number, joint);
        if joint.nameplate.modes.is_none() {
            mode(&raw.eds, &joint.eds, &plan, problems);
        }
        abilities(&raw.eds, &joint.eds, &plan, problems);
        value_limits::check(&raw.eds, &joint.eds, &plan, problems);
    }
    if let Some((switches, raw)) = config.switches.as_ref().zip(raw.switches.as_ref()) {
        if !taken.insert((switches.channel, switches.node.raw())) {
            problems.add(&raw.node_id, "must be unique on its bus");
        }
        identity(&raw.product_code, &switches.eds, &switches.identity, problems);
        abilities(&raw.eds, &switches.eds, &plans::switches(config, switches), problems);
    }
    sync_period(config, raw, problems);
    layouts::check(config, raw, problems);
    gaps(config, raw, problems);
    problems.take(&raw.bus, exchange::resolve(&config.node_plans()))
}

/// Refuses a period that 60C2h cannot hold as one byte times 10ⁿ s. A drive with another interpolation time would miss
/// set-points.
fn sync_period(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let micros = u64::try_from(config.period.as_micros()).unwrap_or(u64::MAX);
    let has_time = |joint: &JointParameters| {
        let described = joint.eds.object(Object::INTERPOLATION_TIME);
        described.is_some_and(|described| described.access.is_writable())
    };
    if setting::interpolation_time(micros).is_none() && config.joints.iter().any(has_time) {
        let fits = |micros: &u64| setting::interpolation_time(*micros).is_some();
        let (below, above) = ((0..micros).rev().find(fits), (micros..).find(fits));
        let near = below.zip(above).map(|(below, above)| format!(": {below} or {above}"));
        let reason = format!(
            "must be a period that 60C2h can hold, one byte times 10^n s{}, got {micros}",
            near.unwrap_or_default()
        );
        problems.add(&raw.node.sync_period_us, reason);
    }
}

/// Returns the reason to refuse the node-id of a joint that another node on its bus has.
fn twice(config: &Parameters, joint: &JointParameters) -> String {
    let node = joint.node.raw();
    let is_same = |other: &&JointParameters| {
        (other.channel, other.node) == (joint.channel, joint.node) && other.name != joint.name
    };
    match config.joints.iter().find(is_same) {
        Some(other) if joint.eds.object(Object::SECOND_CONTROLWORD).is_some() => format!(
            "must be unique on its bus, got {node} twice: node {node} is the drive of {} already, and its second axis (its EDS \
             has 6840h: objects + 800h) cannot be a joint; each joint needs a node of its own",
            other.name
        ),
        Some(_) | None => format!("must be unique on its bus, got {node} twice"),
    }
}

/// Checks that the EDS has the configured vendor and product.
fn identity(at: &impl HasPlace, eds: &Eds, identity: &Identity, problems: &mut Problems<'_>) {
    let Identity { vendor, product, .. } = *identity;
    let (eds_vendor, eds_product) = (eds.vendor(), eds.product());
    if (vendor, product) != (eds_vendor, eds_product) {
        let reason = format!(
            "vendor {vendor:08X}h product {product:08X}h is not what its EDS describes: \
             vendor {eds_vendor:08X}h product {eds_product:08X}h"
        );
        problems.add_of_node(at, reason);
    }
}

/// Checks that the drive supports cyclic synchronous torque, if its EDS states the supported modes (6502h, bit 9).
fn mode(at: &impl HasPlace, eds: &Eds, plan: &NodePlan, problems: &mut Problems<'_>) {
    let modes = eds.object(Object::SUPPORTED_MODES).and_then(|modes| modes.number);
    let modes = modes.map_or(0, |modes| modes.resolve(plan.node));
    if modes != 0 && modes & i128::from(HAS_CYCLIC_TORQUE) == 0 {
        let reason = format!(
            "its drive has no cyclic synchronous torque: 6502h is {modes:08X}h, without bit 9; if it has it, state the value as drive_modes"
        );
        problems.add_of(plan.name.clone(), at, reason);
    }
}

/// Checks that the EDS has every object that the plan writes as writable, those of PDOs excepted.
fn abilities(at: &impl HasPlace, eds: &Eds, plan: &NodePlan, problems: &mut Problems<'_>) {
    for object in plan.demands() {
        match eds.object(object) {
            None => {
                let reason = format!("{object} is not in its EDS{}", remedy(object));
                problems.add_of(plan.name.clone(), at, reason);
            }
            Some(described) if !described.access.is_writable() => {
                let reason = format!("{object} cannot be written");
                problems.add_of(plan.name.clone(), at, reason);
            }
            Some(_) => {}
        }
    }
}

/// Refuses an EDS that lists an object without describing it, if the plan of its node uses that object. Other miscounts
/// are warnings.
fn gaps(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let plans = config.node_plans();
    let keys = raw.joint.all().iter().map(|joint| &joint.eds);
    let keys = keys.chain(raw.switches.iter().map(|switches| &switches.eds));
    for ((_, plan), key) in plans.iter().zip(keys) {
        let Some(path) = key.as_ref().map(|name| files::beside(&config.file, name)) else {
            continue;
        };
        let Some(Ok(sheet)) = problems.sheets().get(&path).cloned() else { continue };
        let is_used = |finding: &&Finding| matches!(finding.gap, Some(Gap::Object(index)) if plan.uses(index));
        let mut used = sheet.gaps.iter().filter(is_used);
        if let Some(gap) = used.next() {
            let others = match used.count() {
                0 => String::new(),
                others => format!(", and {others} more of its findings"),
            };
            let reason = format!("{}:{gap}: the node uses it{others}", path.display());
            problems.add_of(plan.name.clone(), key, reason);
        }
    }
}

/// Returns the remedy for an object that a drive lacks; empty if none is known.
const fn remedy(object: Object) -> &'static str {
    match object {
        Object::MAX_TORQUE => {
            "; name what limits its torque in [joint.torque_limit], or the limit that its maker's tool has set"
        }
        Object::PRODUCER_HEARTBEAT => "; guard the node by guard_time_ms and life_time_factor",
        _ => "",
    }
}
