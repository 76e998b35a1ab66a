//! The simulated world a configuration describes.

use std::time::Duration;

use nalgebra::Matrix3;
use nalgebra::Vector3;

use canopen::NodeId;
use canopen::dictionary::Dictionary;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::object::Object;
use config::Config;
use config::Joint;
use controller::arm::JointKind;
use sim::actuator::ActuatorSettings;
use sim::arm::Arm;
use sim::arm::ArmSettings;
use sim::arm::Joints;
use sim::arm::LinkSettings;
use sim::drive::Drive;
use sim::drive::DriveSettings;
use sim::drivetrain::Drivetrain;
use sim::drivetrain::DrivetrainSettings;
use sim::motion::Load;
use sim::motion::Tuning;
use sim::plant::Plant;
use sim::plant::Resistance;
use sim::scenario::Scenario;
use sim::switches::SwitchBox;
use sim::transmission::Transmission;
use sim::world::World;
use units::numbering::Joint as JointNumber;

/// From a SYNC until a simulated drive begins to send its TPDO.
const DRIVE_LATENCY: Duration = Duration::from_micros(60);

/// Drives, switch box and arm of `config`, and an operator who follows `scenario`.
pub fn build(config: &Config, scenario: Scenario, seed: u64) -> World {
    let inertias = inertias(config);
    let drives = JointNumber::ALL.map(|number| {
        let joint = number.entry(&config.joints);
        let settings = DriveSettings {
            channel: joint.channel,
            node: joint.node,
            dictionary: furnished(joint),
            actuator: actuator(joint),
            latency: DRIVE_LATENCY,
            tuning: tuning(joint, *number.entry(&inertias)),
        };
        Drive::with(settings, &scenario.quirks().of(number))
    });
    let drivetrains = config.joints.each_ref().map(|joint| Drivetrain::new(&drivetrain(joint)));
    let switches = &config.switches;
    let dictionary = numbered(&switches.eds, switches.channel, switches.node);
    let switches = SwitchBox::new(switches.channel, switches.node, dictionary);
    let resistance = config.joints.each_ref().map(|joint| Resistance {
        coulomb: joint.coulomb_friction,
        viscous: joint.viscous_friction,
        range: joint.link.range,
    });
    let plant = Plant::new(arm(config), resistance, start(config));
    World::new(drives, drivetrains, switches, plant, scenario, seed).coupled(transmission(config))
}

/// What a drive holds. Its position unit is an increment of its encoder, whichever that has.
fn furnished(joint: &Joint) -> Dictionary {
    let mut dictionary = numbered(&joint.eds, joint.channel, joint.node);
    dictionary.set_default(Object::FEED, &joint.counts_per_rev.to_le_bytes());
    dictionary
}

/// What a device holds, with a serial number no other has, by which LSS can tell it from its like.
fn numbered(eds: &Eds, Channel(bus): Channel, node: NodeId) -> Dictionary {
    let mut dictionary = Dictionary::new(eds, node);
    let serial = u32::from(bus) << 8 | u32::from(node.raw());
    // An EDS may do without a serial number.
    dictionary.set_default(Object::SERIAL, &serial.to_le_bytes());
    dictionary
}

/// Where the arm is at the start, in rad or m.
pub fn start(config: &Config) -> Joints {
    Joints::from(config.joints.each_ref().map(|joint| joint.start))
}

/// The arm of `config`, as the simulation computes it.
pub fn arm(config: &Config) -> Arm {
    let links = config.joints.each_ref().map(|joint| LinkSettings {
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
    let gravity = Vector3::from(config.gravity);
    Arm::new(ArmSettings { links, x_6_g: config.x_6_g, gravity })
        .driven_through(|rotors| transmission(config).joint_inertia(rotors))
}

fn transmission(config: &Config) -> Transmission {
    let coupling = config.controller.calibration.coupling();
    Transmission::new(coupling.matrix(), *coupling.offset())
}

/// Motor, gear and encoder of a joint, as the simulation computes them.
pub fn actuator(joint: &Joint) -> ActuatorSettings {
    ActuatorSettings {
        counts_per_rev: f64::from(joint.counts_per_rev),
        gear_ratio: joint.gear_ratio,
        zero_counts: joint.zero_counts,
        rated_torque: joint.rated_torque,
        torque_curve: joint.torque_curve,
        max_torque: joint.max_torque,
    }
}

/// All between a joint's current loop and the arm.
fn drivetrain(joint: &Joint) -> DrivetrainSettings {
    let simulated = &joint.simulated;
    DrivetrainSettings {
        actuator: actuator(joint),
        torque_curve_reverse: simulated.torque_curve_reverse,
        current_loop: simulated.current_loop,
        hysteresis: simulated.hysteresis,
        backlash: simulated.backlash,
        rotor_inertia: joint.link.rotor_inertia,
        thermal_time_constant: simulated.thermal_time_constant,
    }
}

/// What each actuator moves where the arm starts, in kg·m² (kg).
fn inertias(config: &Config) -> [f64; 6] {
    let arm = arm(config);
    let joints = arm.mass_matrix(&arm.posture(&start(config)));
    let matrix = config.controller.calibration.coupling().matrix();
    (matrix.transpose() * joints * matrix).diagonal().into()
}

/// What a drive's servo knows of what it moves; of what cannot be, what is usual.
fn tuning(joint: &Joint, inertia: f64) -> Tuning {
    let [per_mille_per_newton_metre, ..] = joint.torque_curve;
    let load = Load {
        inertia,
        viscous: joint.viscous_friction,
        counts_per_turn: f64::from(joint.counts_per_rev) * joint.gear_ratio,
        per_mille_per_newton_metre,
    };
    Tuning::of(&load).unwrap_or_default()
}

/// From xx, yy, zz, xy, xz, yz.
fn inertia([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

#[cfg(test)]
mod tests {
    use config::switch_inputs::SwitchInputs;
    use sim::scenario::fault::Input;

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
