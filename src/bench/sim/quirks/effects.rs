//! Effects of each quirk on a conforming drive.

use std::time::Duration;

use crate::quirks::{FrameQuirks, Quirk, Quirks, TorqueFilter};
use canopen::abort::AbortCode;
use canopen::drive::{CYCLIC_SYNCHRONOUS_TORQUE, Controlword};
use canopen::object::Object;
use canopen::{NodeId, layout};
use canopen_device::dictionary::Dictionary;
use canopen_device::{Application, Misbehaviour};
use units::time::Instant;

/// Deviations of state machine and mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AxisQuirks {
    /// Mode that it obeys and displays, only when enabled.
    pub(crate) mode_when_enabled: Option<i8>,
    /// Set if the first edge of bit 7 after a fault does not reset it.
    pub(crate) ignores_first_reset: bool,
    /// Set if homing methods 35 and 37 move the motor to the index pulse.
    pub(crate) homing_moves: bool,
    /// Bit of the statusword that shows a completed homing.
    pub(crate) referenced_bit: Option<u8>,
}

/// Deviations of the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct EncoderQuirks {
    /// Set if the encoder is incremental.
    pub(crate) is_incremental: bool,
    /// Angle by which the encoder is turned on its shaft, in degrees (mm) of the joint.
    pub(crate) slip: f64,
    /// Motor revolutions that its counter is off at power-up.
    pub(crate) revolutions: i8,
}

/// Deviations of one drive, by what they change.
#[derive(Clone, Debug)]
pub(crate) struct QuirkEffects {
    /// Object dictionary at power-up.
    pub(crate) dictionary: Dictionary,
    /// Deviations of the CANopen slave.
    pub(crate) misbehaviour: Misbehaviour,
    /// Deviations of its transmitted frames.
    pub(crate) frames: FrameQuirks,
    /// Torque applied before the first command, in ‰ of rated torque.
    pub(crate) torque_at_start: Option<i16>,
    /// Filter of torque actual (6077h).
    pub(crate) torque_filter: Option<TorqueFilter>,
    /// Deviations of its state machine and mode.
    pub(crate) axis: AxisQuirks,
    /// Deviations of its encoder.
    pub(crate) encoder: EncoderQuirks,
}

impl QuirkEffects {
    /// Applies `quirks` to the drive of `node`; `dictionary` is that of a conforming drive.
    pub(crate) fn new(quirks: &Quirks, dictionary: Dictionary, node: NodeId) -> Self {
        let mut effects = Self {
            dictionary,
            misbehaviour: Misbehaviour::default(),
            frames: FrameQuirks::default(),
            torque_at_start: None,
            torque_filter: None,
            axis: AxisQuirks::default(),
            encoder: EncoderQuirks::default(),
        };
        quirks.iter().for_each(|quirk| effects.add(quirk, node));
        effects
    }

    fn add(&mut self, quirk: Quirk, node: NodeId) {
        let Self { dictionary, misbehaviour, frames, axis, encoder, .. } = self;
        match quirk {
            Quirk::DeafToMaster => self.confirm_and_discard(Object::CONSUMER_HEARTBEAT, &[0; 4]),
            Quirk::KeepsTorque => self.confirm_and_discard(Object::ABORT_CONNECTION, &[0; 2]),
            Quirk::HoldsTorque => misbehaviour.ignores_connection_loss = true,
            Quirk::OpenRpdos => open_rpdos(dictionary, node),
            Quirk::NoRpdoTimer => {
                let timers = (1..=layout::MAX_PDOS).map(|n| Object::rpdo_communication(n, 5));
                timers.for_each(|timer| dictionary.remove(timer));
            }
            Quirk::SlowSdo(time) => frames.response_delay = time,
            Quirk::UnsizedReplies => misbehaviour.omits_sizes = true,
            Quirk::FixedMapping => {
                misbehaviour.refuses.extend(layout::MAPPINGS.map(|of| (of, AbortCode::READ_ONLY)));
            }
            Quirk::Forgetful(object) => misbehaviour.ignores.push(object),
            Quirk::RunningAtStart(torque) => self.torque_at_start = Some(torque),
            Quirk::LateBoot(time) => frames.boot_delay = time,
            Quirk::NoBootUp => frames.hides_boot_up = true,
            Quirk::HeartbeatLiar => frames.min_heartbeat_period = COARSE_HEARTBEAT_PERIOD,
            Quirk::EmcyStorm => frames.emcy_period = Some(STORM_PERIOD),
            Quirk::DoubleReplies => frames.repeats_responses = true,
            Quirk::VagueAborts => misbehaviour.only_abort_code = Some(AbortCode::GENERAL_ERROR),
            Quirk::WrongIdentity => {
                let product = !dictionary.unsigned(Object::PRODUCT_CODE);
                dictionary.set_default(Object::PRODUCT_CODE, &product.to_le_bytes());
            }
            Quirk::NoSyncCounter => dictionary.remove(Object::SYNC_OVERFLOW),
            Quirk::QuietFault => frames.hides_emergencies = true,
            Quirk::NoRtr => {
                misbehaviour.refuses_remote_tpdos = true;
                forbid_remote_tpdos(dictionary);
            }
            Quirk::LostSdoReply(number) => frames.lost_response = Some(number),
            Quirk::SlowFirstAnswer(time) => frames.first_response_delay = time,
            Quirk::FilteredTorque(percent) => {
                self.torque_filter = Some(TorqueFilter::new(percent));
            }
            Quirk::ModeWhenOperational => {
                misbehaviour.needs_operational.push(Object::MODE_OF_OPERATION);
            }
            Quirk::ModeWhenEnabled(mode) => axis.mode_when_enabled = Some(mode),
            Quirk::TwoResetEdges => axis.ignores_first_reset = true,
            Quirk::LostWriteReply(number) => frames.lost_confirmation = Some(number),
            Quirk::Incremental => encoder.is_incremental = true,
            Quirk::EncoderSlipped(slip) => encoder.slip = slip,
            Quirk::WrongRevolution(revolutions) => encoder.revolutions = revolutions,
            Quirk::HomingMoves => axis.homing_moves = true,
            Quirk::ReferencedBit(bit) => axis.referenced_bit = Some(bit),
            Quirk::PolarityReversed | Quirk::Stored(..) => {
                if let Some((object, value)) = quirk.stores() {
                    dictionary.set_default_number(object, value);
                }
            }
        }
    }

    fn confirm_and_discard(&mut self, object: Object, value: &[u8]) {
        self.dictionary.set_default(object, value);
        self.misbehaviour.ignores.push(object);
    }
}

/// Puts the drive in operation enabled with `torque`, in ‰ of rated torque, as a master would have.
pub(crate) fn start_running(
    torque: i16,
    drive: &mut impl Application,
    dictionary: &mut Dictionary,
) {
    // Leaves the power-up state: NMT initialisation is over.
    drive.on_time(Instant::ZERO, dictionary);
    let mut write = |object, value: &[u8]| {
        dictionary.set(object, value);
        drive.written(dictionary, object);
    };
    write(Object::MODE_OF_OPERATION, &CYCLIC_SYNCHRONOUS_TORQUE.to_le_bytes());
    write(Object::TARGET_TORQUE, &torque.to_le_bytes());
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
        write(Object::CONTROLWORD, &word.0.to_le_bytes());
    }
}

/// Enables RPDO 2 to 4, each asynchronous with controlword and target torque. A frame sent with one of
/// their COB-IDs by mistake moves the drive.
fn open_rpdos(dictionary: &mut Dictionary, node: NodeId) {
    let entry = |object: Object| {
        let [low, high] = object.index.to_le_bytes();
        [16, object.sub, low, high]
    };
    for number in 2..=4 {
        let cob_id = u32::from(layout::rpdo1(node)) + 0x100 * u32::from(number - 1);
        dictionary.set_default(Object::rpdo_communication(number, 1), &cob_id.to_le_bytes());
        dictionary.set_default(Object::rpdo_communication(number, 2), &[255]);
        for (sub, object) in [(1, Object::CONTROLWORD), (2, Object::TARGET_TORQUE)] {
            dictionary.set_default(Object::rpdo_mapping(number, sub), &entry(object));
        }
        dictionary.set_default(Object::rpdo_mapping(number, 0), &[2]);
    }
}

/// Sets bit 30 in the COB-IDs of all TPDOs.
fn forbid_remote_tpdos(dictionary: &mut Dictionary) {
    for number in 1..=layout::MAX_PDOS {
        let cob_id = Object::tpdo_communication(number, 1);
        if let Some(raw) = dictionary.optional(cob_id) {
            dictionary.set_default_number(cob_id, raw | NO_REMOTE);
        }
    }
}

/// Bit 30 of the COB-ID of a TPDO: no remote frames.
const NO_REMOTE: u32 = 1 << 30;
/// Shortest heartbeat period of a coarse timer.
const COARSE_HEARTBEAT_PERIOD: Duration = Duration::from_millis(100);
/// Period of EMCY messages in a storm.
const STORM_PERIOD: Duration = Duration::from_millis(5);
