//! Simulated world of a configuration: drives, switch box, arm, operator.

use std::time::Duration;

use nalgebra::{Matrix3, Vector3};

use crate::delivery::DeliveryState;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::object::Object;
use canopen::plan::Identity;
use canopen_device::dictionary::Dictionary;
use config::zero::ZeroSource;
use config::{Actuator, Config, JointParameters, JointPlant, Plant};
use controller::arm::JointKind;
use sim::actuator::ActuatorSettings;
use sim::arm::{Arm, ArmSettings, Joints, LinkSettings};
use sim::cradle::Cradle;
use sim::drive::{Drive, DriveSettings, EncoderKind};
use sim::drivetrain::{Drivetrain, DrivetrainSettings};
use sim::motion::{Load, Tuning};
use sim::plant::{self, Resistance};
use sim::scenario::Scenario;
use sim::switches::SwitchBox;
use sim::transmission::Transmission;
use sim::world::World;
use units::numbering::Joint;

/// Time from a SYNC until a simulated drive sends its TPDO.
const DRIVE_LATENCY: Duration = Duration::from_micros(60);

/// Creates drives, switch box and arm of `config`, and an operator who follows `scenario`.
pub fn build(config: &Config, scenario: Scenario, seed: u64) -> World {
    let plant = config.plant();
    let inertias = inertias(&plant);
    let drives = Joint::ALL.map(|number| {
        let joint = number.entry(&config.joints);
        let dictionary = drive_dictionary(joint);
        let DeliveryState { delivery, increments } = DeliveryState::new(joint, &dictionary);
        let actuator =
            ActuatorSettings { counts_per_rev: increments, ..actuator(&joint.plant.actuator) };
        let settings = DriveSettings {
            channel: joint.channel,
            node: joint.node,
            dictionary,
            actuator,
            encoder: encoder(joint),
            is_prismatic: joint.plant.link.kind == JointKind::Prismatic,
            latency: DRIVE_LATENCY,
            tuning: tuning(&joint.plant, increments, *number.entry(&inertias)),
        };
        Drive::delivered(settings, &delivery, &scenario.quirks().for_joint(number))
    });
    let drivetrains = plant.joints.each_ref().map(|joint| Drivetrain::new(&drivetrain(joint)));
    let switches = config.switches.as_ref().map(|switches| {
        let dictionary = dictionary(&switches.eds, switches.channel, switches.node);
        SwitchBox::new(switches.channel, switches.node, dictionary)
    });
    let resistance = plant.joints.each_ref().map(resistance);
    let moving = plant::Plant::new(arm(&plant), resistance, start(&plant));
    World::new(drives, drivetrains, switches, moving, scenario, seed)
        .coupled(transmission(&plant))
        .resting(cradle(config, &plant))
}

/// Returns the cradle of an arm with a rest posture, where the arm lies at the start; it supports the joints that have one.
fn cradle(config: &Config, plant: &Plant) -> Cradle {
    let rests = config.joints.each_ref().map(|joint| joint.rest);
    if rests.iter().all(Option::is_none) {
        return Cradle::none();
    }
    let (arm, start) = (arm(plant), start(plant));
    let weight = arm.gravity(&arm.posture(&start));
    let supported = Joints::from(rests.map(|rest| if rest.is_some() { 1.0 } else { 0.0 }));
    Cradle::new(start, weight.component_mul(&supported))
}

/// Returns the simulated friction and end stops of a joint.
pub const fn resistance(joint: &JointPlant) -> Resistance {
    Resistance {
        coulomb: joint.friction.coulomb,
        stiction: joint.drivetrain.stiction,
        viscous: joint.friction.viscous,
        range: joint.link.range,
    }
}

/// Returns the dictionary of a drive. The configured identity replaces one that is absent in the EDS.
fn drive_dictionary(joint: &JointParameters) -> Dictionary {
    let mut dictionary = dictionary(&joint.eds, joint.channel, joint.node);
    let Identity { vendor, product, revision } = joint.identity;
    for (object, value) in
        [(Object::VENDOR_ID, vendor), (Object::PRODUCT_CODE, product), (Object::REVISION, revision)]
    {
        if dictionary.unsigned(object) == 0 {
            dictionary.set_default(object, &value.to_le_bytes());
        }
    }
    dictionary
}

/// Returns the dictionary of a device with a unique serial number, for LSS.
fn dictionary(eds: &Eds, Channel(bus): Channel, node: NodeId) -> Dictionary {
    let mut dictionary = Dictionary::new(eds, node);
    let serial = u32::from(bus) << 8 | u32::from(node.raw());
    // A serial number is optional in an EDS.
    dictionary.set_default(Object::SERIAL, &serial.to_le_bytes());
    dictionary
}

/// Returns the joint positions at the start, in rad or m.
pub fn start(plant: &Plant) -> Joints {
    Joints::from(plant.joints.each_ref().map(|joint| joint.start))
}

/// Returns the simulated arm.
pub fn arm(plant: &Plant) -> Arm {
    let links = plant.joints.each_ref().map(|joint| LinkSettings {
        is_prismatic: joint.link.kind == JointKind::Prismatic,
        alpha: joint.link.alpha,
        a: joint.link.a,
        d: joint.link.d,
        theta: joint.link.theta,
        mass: joint.link.mass,
        centre_of_mass: Vector3::from(joint.link.centre_of_mass),
        inertia: inertia(joint.link.inertia),
        rotor_inertia: joint.link.rotor_inertia,
    });
    let gravity = Vector3::from(plant.gravity);
    Arm::new(ArmSettings { links, x_6_g: plant.x_6_g, gravity })
        .driven_through(|rotors| transmission(plant).joint_inertia(rotors))
}

fn transmission(plant: &Plant) -> Transmission {
    Transmission::new(plant.coupling.matrix(), *plant.coupling.offset())
}

/// Returns the encoder that the configuration says: what a power cycle leaves of its position.
fn encoder(joint: &JointParameters) -> EncoderKind {
    match joint.zero.source {
        ZeroSource::Absolute => EncoderKind::Absolute,
        ZeroSource::SingleTurn { counts } => EncoderKind::SingleTurn {
            unique_turns: counts / f64::from(joint.plant.actuator.counts_per_rev),
        },
        ZeroSource::Rest | ZeroSource::Homing(_) => EncoderKind::Incremental,
    }
}

/// Returns the simulated motor and gear of a joint, and an encoder whose increments are those of 6064h.
pub fn actuator(actuator: &Actuator) -> ActuatorSettings {
    ActuatorSettings {
        counts_per_rev: f64::from(actuator.counts_per_rev),
        gear_ratio: actuator.gear_ratio,
        zero_counts: actuator.zero_counts,
        rated_torque: actuator.rated_torque,
        torque_curve: actuator.torque_curve,
        max_torque: actuator.max_torque,
    }
}

/// Returns the drivetrain from a joint's current loop to the arm.
fn drivetrain(joint: &JointPlant) -> DrivetrainSettings {
    DrivetrainSettings {
        actuator: actuator(&joint.actuator),
        torque_curve_reverse: joint.drivetrain.torque_curve_reverse,
        current_loop: joint.drivetrain.current_loop,
        hysteresis: joint.drivetrain.hysteresis,
        backlash: joint.drivetrain.backlash,
        rotor_inertia: joint.link.rotor_inertia,
        thermal_time_constant: joint.drivetrain.thermal_time_constant,
    }
}

/// Returns the inertia at each actuator in the start posture, in kg·m² (kg).
fn inertias(plant: &Plant) -> [f64; 6] {
    let arm = arm(plant);
    let joints = arm.mass_matrix(&arm.posture(&start(plant)));
    let matrix = plant.coupling.matrix();
    (matrix.transpose() * joints * matrix).diagonal().into()
}

/// Returns the servo gains for a load and an encoder with `increments` per revolution; the default ones for an invalid load.
fn tuning(joint: &JointPlant, increments: f64, inertia: f64) -> Tuning {
    let [per_mille_per_newton_metre, ..] = joint.actuator.torque_curve;
    let load = Load {
        inertia,
        viscous: joint.friction.viscous,
        counts_per_turn: increments * joint.actuator.gear_ratio,
        per_mille_per_newton_metre,
    };
    Tuning::from_load(&load).unwrap_or_default()
}

/// Returns the inertia tensor of xx, yy, zz, xy, xz, yz.
pub(crate) fn inertia([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

#[cfg(test)]
mod tests {
    use config::switch_inputs::SwitchInputs;
    use faults::Input;

    #[test]
    fn switches_of_the_simulation_are_those_the_node_reads() {
        let none = SwitchInputs::default();
        for (input, read) in [
            (Input::DeadmanA, SwitchInputs { deadman_a: true, ..none }),
            (Input::DeadmanB, SwitchInputs { deadman_b: true, ..none }),
            (Input::Reference, SwitchInputs { reference: true, ..none }),
            (Input::Reflection, SwitchInputs { reflection: true, ..none }),
        ] {
            assert_eq!(SwitchInputs::from_bits(input.bit()), read);
        }
    }
}
