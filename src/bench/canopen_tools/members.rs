//! Members of this hand controller's buses: names, units and scales of their signals, and bus timing.
//!
//! Uses the figures that `controller::calibration` computes with.

use std::collections::HashSet;
use std::time::Duration;

use crate::decode::bus_monitor::Timing;
use crate::signals::{ACTUATOR_POSITION, Curve, Measure, Member, identifier};
use canopen::frame::Channel;
use canopen::object::Object;
use canopen::plan::NodePlan;
use config::{Config, JointParameters};
use controller::arm::JointKind;

/// Nodes of the configuration: the joints' drives, then the switch box.
pub fn members(config: &Config) -> Vec<Member> {
    let mut taken = HashSet::from(["master".to_owned()]);
    let member = |(channel, plan): (Channel, NodePlan)| {
        let is_its = |joint: &&JointParameters| (joint.channel, joint.node) == (channel, plan.node);
        let joint = config.joints.iter().position(|joint| is_its(&joint));
        let joint = joint.and_then(|place| Some((place, config.joints.get(place)?)));
        let name = joint.map_or("switch_box", |(_, joint)| joint.name.as_str());
        let mut name = identifier(name);
        if name.is_empty() || name.starts_with(|first: char| first.is_ascii_digit()) {
            name.insert_str(0, "joint_");
        }
        if !taken.insert(name.clone()) {
            name = format!("{name}_{}", plan.node.raw());
            taken.insert(name.clone());
        }
        let measures = joint.map(|(place, joint)| measures(config, place, joint));
        let eds = config.eds_of(channel, plan.node).cloned();
        let measures = measures.unwrap_or_default();
        Member { name, channel, plan, measures, eds }
    };
    config.node_plans().into_iter().map(member).collect()
}

/// Timing of the buses.
pub fn timing(config: &Config) -> Timing {
    Timing {
        period: config.period,
        window: config.window(),
        master: config.node_id.raw(),
        master_lost: Duration::from_millis(u64::from(config.safety.node_lost_ms)),
    }
}

fn measures(config: &Config, place: usize, joint: &JointParameters) -> Vec<(Object, Measure)> {
    let moved = moved(config, place);
    let position = position(joint, &moved);
    let most = f64::from(joint.calibration.max_target().0);
    let torque = |most: f64, quantity| Measure {
        quantity,
        zero: 0,
        step: joint.plant.actuator.rated_torque / PER_MILLE,
        unit: "N·m",
        range: Some([
            -most * joint.plant.actuator.rated_torque / PER_MILLE,
            most * joint.plant.actuator.rated_torque / PER_MILLE,
        ]),
        curve: Some(curve(joint, &moved)),
    };
    let largest = f64::from(i16::MAX);
    vec![
        (Object::POSITION_ACTUAL, position),
        (Object::TORQUE_ACTUAL, torque(largest, "torque")),
        (Object::TARGET_TORQUE, torque(most, "target_torque")),
        (Object::TORQUE_DEMAND, torque(most, "torque_demand")),
    ]
}

/// Resolution of 6071h, 6074h and 6077h, in parts of the rated torque.
const PER_MILLE: f64 = 1_000.0;

/// Relation of an actuator to the joint of its row.
struct ActuatorCoupling {
    /// Set if it alone determines the joint's position.
    has_position_of_joint: bool,
    /// Set if it alone determines the joint's torque.
    has_torque_of_joint: bool,
}

/// Returns whether row and column of the coupling are those of an uncoupled joint.
fn moved(config: &Config, place: usize) -> ActuatorCoupling {
    let coupling = config.controller.calibration.coupling();
    let one = coupling.matrix() - nalgebra::SMatrix::<f64, 6, 6>::identity();
    let is_zero = |number: &f64| number.abs() < f64::EPSILON;
    let row = (0..6).filter_map(|column| one.get((place, column))).all(is_zero);
    let column = (0..6).filter_map(|row| one.get((row, place))).all(is_zero);
    let offset = coupling.offset().get(place).is_none_or(is_zero);
    ActuatorCoupling { has_position_of_joint: row && offset, has_torque_of_joint: column }
}

fn position(joint: &JointParameters, moved: &ActuatorCoupling) -> Measure {
    let quantum = joint.calibration.quantum().copysign(joint.plant.actuator.gear_ratio);
    Measure {
        quantity: if moved.has_position_of_joint { "position" } else { ACTUATOR_POSITION },
        zero: joint.plant.actuator.zero_counts,
        step: quantum,
        unit: match joint.plant.link.kind {
            JointKind::Revolute => "rad",
            JointKind::Prismatic => "m",
        },
        range: moved.has_position_of_joint.then_some(joint.plant.link.range),
        curve: None,
    }
}

/// Joint torque at every target of its drive.
fn curve(joint: &JointParameters, moved: &ActuatorCoupling) -> Curve {
    let direction = joint.plant.actuator.gear_ratio.signum();
    let last = joint.calibration.max_target().0.max(0);
    let torque = |target: i16| match target {
        0 => 0.0,
        _ => joint.calibration.curve().torque(f64::from(target)) * direction,
    };
    Curve {
        place: if moved.has_torque_of_joint { "joint" } else { "actuator" },
        unit: match joint.plant.link.kind {
            JointKind::Revolute => "N·m",
            JointKind::Prismatic => "N",
        },
        table: (0..=last).map(torque).collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use units::drive::{Counts, PerMille};

    const CONFIGS: [&str; 2] = ["config/kraft_like.toml", "config/jpl_like.toml"];

    fn measure(member: &Member, object: Object) -> &Measure {
        &member.measures.iter().find(|(measured, _)| *measured == object).unwrap().1
    }

    /// Configuration of the first arm with two coupled joints.
    fn coupled() -> Config {
        let file = Path::new(CONFIGS[0]);
        let text = include_str!("../../../config/kraft_like.toml");
        let rows = (0..6).map(|row| {
            let one = |column: usize| if row == column { 1.0 } else { 0.0 };
            let numbers: Vec<_> = (0..6)
                .map(|column| if (row, column) == (2, 1) { -1.0 } else { one(column) })
                .map(|number: f64| format!("{number:?}"))
                .collect();
            format!("[{}]", numbers.join(", "))
        });
        let matrix = rows.collect::<Vec<_>>().join(", ");
        let offset = "offset_rad_or_m = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]";
        let coupling = format!("[coupling]\nmatrix = [{matrix}]\n{offset}\n\n[switches]");
        Config::parse(file, &text.replacen("[switches]", &coupling, 1)).unwrap()
    }

    #[test]
    fn signals_of_a_coupled_joint_are_its_actuators() {
        let members = members(&coupled());
        let position = |place: usize| measure(&members[place], Object::POSITION_ACTUAL).quantity;
        let torque = |place: usize| {
            measure(&members[place], Object::TORQUE_ACTUAL).curve.as_ref().unwrap().place
        };
        assert_eq!([0, 1, 2].map(position), ["position", "position", "actuator_position"]);
        assert_eq!([0, 1, 2].map(torque), ["joint", "actuator", "joint"]);
    }

    #[test]
    fn every_node_has_a_unique_name() {
        for file in CONFIGS {
            let members = members(&Config::load(Path::new(file)).unwrap());
            let names: HashSet<_> = members.iter().map(|member| &member.name).collect();
            assert_eq!(names.len(), 7);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn signals_match_the_controllers_calibration(
            counts in any::<[i32; 6]>(),
            actual in proptest::array::uniform6(-900_i16..900),
        ) {
            for file in CONFIGS {
                let config = Config::load(Path::new(file)).unwrap();
                let calibration = &config.controller.calibration;
                let positions = calibration.positions(&counts.map(Counts));
                let torques = calibration.torques(&actual.map(PerMille));
                let members = members(&config);
                for place in 0..6 {
                    let position = measure(&members[place], Object::POSITION_ACTUAL);
                    let decoded = position.value(i64::from(counts[place]));
                    prop_assert!((decoded - positions[place]).abs() < 1e-9 * (1.0 + decoded.abs()));
                    let torque = measure(&members[place], Object::TORQUE_ACTUAL);
                    let decoded = torque.curve.as_ref().unwrap().at(i64::from(actual[place]));
                    prop_assert!((decoded - torques[place]).abs() < 1e-9, "{} {}", decoded, torques[place]);
                }
            }
        }
    }
}
