//! What each drive believes of itself, and what is so at its joint.
//!
//! A snapshot, for people and scripts; the drive side is what an SDO client would read from it.

use crate::drive::Drive;
use crate::world::World;
use canopen::NmtState;
use canopen::NodeId;
use canopen::drive::State;
use canopen::frame::Channel;
use canopen::object::Object;
use units::time::Instant;

/// What one drive believes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Its bus.
    pub channel: Channel,
    /// Its node-id.
    pub node: NodeId,
    /// Of its communication.
    pub nmt: NmtState,
    /// Of its power stage.
    pub state: State,
    /// Its mode of operation (6061h).
    pub mode: i8,
    /// What it asks of its motor, in N·m.
    pub demanded: f64,
    /// What it thinks its motor exerts (6077h of 6076h), in N·m.
    pub exerted: f64,
    /// Where it thinks its motor is (6064h), in counts.
    pub counts: i32,
    /// Of its winding, in °C.
    pub temperature: f64,
    /// The code of its last error (603Fh), 0 for none.
    pub error: u16,
}

/// One drive and its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// What the drive believes.
    pub belief: Belief,
    /// Where the joint is, in rad (m).
    pub position: f64,
    /// What the motor exerts on it, in N·m (N).
    pub torque: f64,
}

/// All drives and joints at one moment, base first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Up to when the arm has moved.
    pub at: Instant,
    /// One for each joint.
    pub axes: [Axis; 6],
}

impl Belief {
    /// What `drive` believes now.
    pub fn of(drive: &Drive) -> Self {
        let dictionary = drive.dictionary();
        let rated = f64::from(dictionary.unsigned(Object::RATED_TORQUE)) / 1e3;
        let newton_metres = |per_mille: f64| per_mille / 1e3 * rated;
        Self {
            channel: drive.channel(),
            node: drive.node(),
            nmt: drive.nmt_state(),
            state: drive.state(),
            mode: dictionary.i8(Object::MODE_DISPLAY),
            demanded: newton_metres(drive.demand()),
            exerted: newton_metres(f64::from(dictionary.i16(Object::TORQUE_ACTUAL))),
            counts: dictionary.unsigned(Object::POSITION_ACTUAL).cast_signed(),
            temperature: f64::from(dictionary.i16(Object::WINDING_TEMPERATURE)) / 10.0,
            error: drive.last_error(),
        }
    }
}

impl Report {
    /// What there is to tell of `world` now.
    pub fn of(world: &World) -> Self {
        let mut axes = world.drives().each_ref().map(|drive| Axis {
            belief: Belief::of(drive),
            position: 0.0,
            torque: 0.0,
        });
        let torques = world.torques();
        let truths = world.plant().q().iter().zip(&torques);
        for (axis, (position, torque)) in axes.iter_mut().zip(truths) {
            (axis.position, axis.torque) = (*position, *torque);
        }
        Self { at: world.now(), axes }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use canopen_rs::NmtCommand;

    use super::*;
    use crate::actuator::ActuatorSettings;
    use crate::drive::DriveSettings;
    use crate::drivetrain::Sensed;
    use crate::motion::Tuning;
    use canopen::dictionary::Dictionary;
    use canopen::eds::Eds;
    use canopen::frame::Frame;
    use canopen::nmt::Order;
    use canopen::station::Station;

    const RATED: f64 = 0.2;

    fn drive() -> Drive {
        let node = NodeId::new(3).unwrap();
        let eds = Eds::parse(include_bytes!("../../eds/frhc_drive.eds")).unwrap();
        Drive::new(DriveSettings {
            channel: Channel(1),
            node,
            dictionary: Dictionary::new(&eds, node),
            actuator: ActuatorSettings {
                counts_per_rev: 16_384.0,
                gear_ratio: 1.0,
                zero_counts: 100,
                rated_torque: RATED,
                torque_curve: [133.0, 0.0, 0.0],
                max_torque: 6.0,
            },
            latency: Duration::ZERO,
            tuning: Tuning::default(),
        })
    }

    /// An expedited download to node 3.
    fn write(drive: &mut Drive, index: u16, bytes: &[u8]) {
        let specifier = 0x23 | u8::try_from(4 - bytes.len()).unwrap() << 2;
        let [low, high] = index.to_le_bytes();
        let mut data = [specifier, low, high, 0, 0, 0, 0, 0];
        data[4..4 + bytes.len()].copy_from_slice(bytes);
        drive.on_frame(Instant::ZERO, Channel(1), &Frame::new(0x603, data), &mut Vec::new());
    }

    #[test]
    fn a_drive_out_of_the_box_believes_in_nothing_yet() {
        let mut drive = drive();
        drive.on_time(Instant::ZERO, &mut Vec::new());
        let belief = Belief::of(&drive);
        assert_eq!((belief.channel, belief.node.raw()), (Channel(1), 3));
        assert_eq!(belief.nmt, NmtState::PreOperational);
        assert_eq!((belief.state, belief.mode, belief.error), (State::SwitchOnDisabled, 0, 0));
        assert_eq!((belief.demanded, belief.exerted), (0.0, 0.0));
    }

    #[test]
    fn what_it_was_told_and_what_it_senses_is_what_it_believes() {
        let mut drive = drive();
        let start = Order::to(drive.node(), NmtCommand::StartRemoteNode).frame();
        drive.on_time(Instant::ZERO, &mut Vec::new());
        drive.on_frame(Instant::ZERO, Channel(1), &start, &mut Vec::new());
        write(&mut drive, 0x6060, &[10]);
        write(&mut drive, 0x6072, &1_000_u16.to_le_bytes());
        for controlword in [0x06_u16, 0x07, 0x0F] {
            write(&mut drive, 0x6040, &controlword.to_le_bytes());
        }
        write(&mut drive, 0x6071, &250_i16.to_le_bytes());
        drive.sense(&Sensed { position: std::f64::consts::TAU, ..Sensed::default() });
        let belief = Belief::of(&drive);
        assert_eq!((belief.nmt, belief.state), (NmtState::Operational, State::OperationEnabled));
        assert_eq!((belief.mode, belief.counts), (10, 16_484));
        assert!((belief.demanded - 0.25 * RATED).abs() < 1e-12, "{belief:?}");
        drive.fail_with(0x8611);
        let belief = Belief::of(&drive);
        assert_eq!(belief.error, 0x8611);
        assert_ne!(belief.state, State::OperationEnabled);
    }
}
