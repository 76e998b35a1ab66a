//! Snapshot of all drives: the drive view, as an SDO client would read it, beside the ground truth of the joint.

use crate::drive::Drive;
use crate::world::World;
use canopen::drive::State;
use canopen::frame::Channel;
use canopen::object::Object;
use canopen::{NmtState, NodeId};
use units::time::Instant;

/// Values of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveView {
    /// CAN bus.
    pub channel: Channel,
    pub node: NodeId,
    /// State of the NMT slave.
    pub nmt: NmtState,
    /// State of the power drive system.
    pub state: State,
    /// Mode of operation (6061h).
    pub mode: i8,
    /// Torque demand (6074h), in N·m.
    pub demand_torque: f64,
    /// Torque actual value (6077h), in N·m.
    pub actual_torque: f64,
    /// Position actual value (6064h), in counts.
    pub position_counts: i32,
    /// Winding temperature, in °C.
    pub temperature: f64,
    /// Error code (603Fh), 0 for none.
    pub error: u16,
}

/// One drive and its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Values the drive reports.
    pub view: DriveView,
    /// Ground truth: joint position, in rad (m).
    pub position: f64,
    /// Ground truth: motor torque at the joint, in N·m (N).
    pub torque: f64,
}

/// All drives and joints at one time, base first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Simulation time of the arm.
    pub at: Instant,
    /// One entry per joint.
    pub axes: [Axis; 6],
}

impl DriveView {
    /// Reads the values of `drive`.
    pub fn new(drive: &Drive) -> Self {
        let dictionary = drive.dictionary();
        let newton_metres = |per_mille: f64| per_mille / 1e3 * drive.rated_torque();
        Self {
            channel: drive.channel(),
            node: drive.node(),
            nmt: drive.nmt_state(),
            state: drive.state(),
            mode: dictionary.i8(Object::MODE_DISPLAY),
            demand_torque: newton_metres(drive.demand()),
            actual_torque: newton_metres(drive.feedback().per_mille.round()),
            position_counts: dictionary.unsigned(Object::POSITION_ACTUAL).cast_signed(),
            temperature: (10.0 * drive.temperature()).round() / 10.0,
            error: drive.last_error(),
        }
    }
}

impl Report {
    /// Takes a snapshot of `world`.
    pub fn new(world: &World) -> Self {
        let mut axes = world.drives().each_ref().map(|drive| Axis {
            view: DriveView::new(drive),
            position: 0.0,
            torque: 0.0,
        });
        let torques = world.torques();
        let true_values = world.plant().q().iter().zip(&torques);
        for (axis, (position, torque)) in axes.iter_mut().zip(true_values) {
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
    use crate::drive::{DriveSettings, EncoderKind};
    use crate::drivetrain::MotorReading;
    use crate::motion::Tuning;
    use canopen::eds::Eds;
    use canopen::frame::Frame;
    use canopen::nmt::Order;
    use canopen_device::dictionary::Dictionary;
    use canopen_device::station::Station;

    const RATED: f64 = 0.2;

    fn drive() -> Drive {
        let node = NodeId::new(3).unwrap();
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_drive.eds")).unwrap();
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
            encoder: EncoderKind::Absolute,
            is_prismatic: false,
            latency: Duration::ZERO,
            tuning: Tuning::default(),
        })
    }

    /// Expedited download to node 3.
    fn write(drive: &mut Drive, index: u16, bytes: &[u8]) {
        let specifier = 0x23 | u8::try_from(4 - bytes.len()).unwrap() << 2;
        let [low, high] = index.to_le_bytes();
        let mut data = [specifier, low, high, 0, 0, 0, 0, 0];
        data[4..4 + bytes.len()].copy_from_slice(bytes);
        drive.on_frame(Instant::ZERO, Channel(1), &Frame::new(0x603, data), &mut Vec::new());
    }

    #[test]
    fn drive_view_at_power_up_has_default_values() {
        let mut drive = drive();
        drive.on_time(Instant::ZERO, &mut Vec::new());
        let view = DriveView::new(&drive);
        assert_eq!((view.channel, view.node.raw()), (Channel(1), 3));
        assert_eq!(view.nmt, NmtState::PreOperational);
        assert_eq!((view.state, view.mode, view.error), (State::SwitchOnDisabled, 0, 0));
        assert_eq!((view.demand_torque, view.actual_torque), (0.0, 0.0));
    }

    #[test]
    fn drive_view_has_written_and_measured_values() {
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
        drive.sense(&MotorReading { position: std::f64::consts::TAU, ..MotorReading::default() });
        let view = DriveView::new(&drive);
        assert_eq!((view.nmt, view.state), (NmtState::Operational, State::OperationEnabled));
        assert_eq!((view.mode, view.position_counts), (10, 16_484));
        assert!((view.demand_torque - 0.25 * RATED).abs() < 1e-12, "{view:?}");
        drive.fail_with(0x8611);
        let view = DriveView::new(&drive);
        assert_eq!(view.error, 0x8611);
        assert_ne!(view.state, State::OperationEnabled);
    }
}
