//! The table of what each quirk does to a good drive.

use std::time::Duration;

use crate::personality::Habits;
use crate::personality::Personality;
use crate::personality::Quirk;
use canopen::NodeId;
use canopen::abort::AbortCode;
use canopen::device::Application;
use canopen::device::Manners;
use canopen::dictionary::Dictionary;
use canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use canopen::drive::Controlword;
use canopen::layout;
use canopen::object::Object;
use units::time::Instant;

/// What a drive is made of, apart from what it does as a drive.
#[derive(Clone, Debug)]
pub(crate) struct Makeup {
    /// What it holds after power-up.
    pub(crate) dictionary: Dictionary,
    /// How it treats its SDO client and its master.
    pub(crate) manners: Manners,
    /// What happens to its frames.
    pub(crate) habits: Habits,
    /// What it pushes with before anybody has told it to, in ‰ of rated torque.
    pub(crate) torque_at_start: Option<i16>,
}

impl Makeup {
    /// Of the drive of `node`, where a good one holds `dictionary`.
    pub(crate) fn of(personality: &Personality, dictionary: Dictionary, node: NodeId) -> Self {
        let mut makeup = Self {
            dictionary,
            manners: Manners::default(),
            habits: Habits::default(),
            torque_at_start: None,
        };
        personality.quirks().for_each(|quirk| makeup.add(quirk, node));
        makeup
    }

    fn add(&mut self, quirk: Quirk, node: NodeId) {
        let Self { dictionary, manners, habits, torque_at_start } = self;
        match quirk {
            Quirk::DeafToMaster => self.never_takes(Object::CONSUMER_HEARTBEAT, &[0; 4]),
            Quirk::KeepsTorque => self.never_takes(Object::ABORT_CONNECTION, &[0; 2]),
            Quirk::HoldsTorque => manners.ignores_connection_loss = true,
            Quirk::OpenRpdos => open_rpdos(dictionary, node),
            Quirk::NoRpdoTimer => {
                let timers = (1..=layout::MOST_PDOS).map(|n| Object::rpdo_communication(n, 5));
                timers.for_each(|timer| dictionary.remove(timer));
            }
            Quirk::SlowSdo(time) => habits.reply_delay = time,
            Quirk::UnsizedReplies => manners.hides_sizes = true,
            Quirk::FixedMapping => {
                manners.refuses.extend(layout::MAPPINGS.map(|of| (of, AbortCode::READ_ONLY)));
            }
            Quirk::Forgetful(object) => manners.ignores.push(object),
            Quirk::RunningAtStart(torque) => *torque_at_start = Some(torque),
            Quirk::LateBoot(time) => habits.boot_delay = time,
            Quirk::NoBootUp => habits.hides_boot_up = true,
            Quirk::HeartbeatLiar => habits.least_period = COARSE_TIMER,
            Quirk::EmcyStorm => habits.storm = Some(STORM),
            Quirk::DoubleReplies => habits.repeats_replies = true,
            Quirk::VagueAborts => manners.only_abort = Some(AbortCode::GENERAL_ERROR),
            Quirk::WrongIdentity => {
                let product = !dictionary.unsigned(Object::PRODUCT_CODE);
                dictionary.furnish(Object::PRODUCT_CODE, &product.to_le_bytes());
            }
            Quirk::NoSyncCounter => dictionary.remove(Object::SYNC_OVERFLOW),
            Quirk::QuietFault => habits.hides_emergencies = true,
        }
    }

    fn never_takes(&mut self, object: Object, value: &[u8]) {
        self.dictionary.furnish(object, value);
        self.manners.ignores.push(object);
    }
}

/// A drive pushes with `torque` ‰, as if its master had led it there.
pub(crate) fn begin(torque: i16, drive: &mut impl Application, dictionary: &mut Dictionary) {
    // It has been switched on a while ago.
    drive.on_time(Instant::ZERO, dictionary);
    let mut tell = |object, value: &[u8]| {
        dictionary.set(object, value);
        drive.written(dictionary, object);
    };
    tell(Object::MODE_OF_OPERATION, &CYCLIC_SYNCHRONOUS_TORQUE.to_le_bytes());
    tell(Object::TARGET_TORQUE, &torque.to_le_bytes());
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
        tell(Object::CONTROLWORD, &word.0.to_le_bytes());
    }
}

/// RPDO 2 to 4 are on and act at once, and each is a controlword and a target torque: whoever sends one
/// of them, by mistake or to somebody else, moves the drive.
fn open_rpdos(dictionary: &mut Dictionary, node: NodeId) {
    let entry = |object: Object| {
        let [low, high] = object.index.to_le_bytes();
        [16, object.sub, low, high]
    };
    for number in 2..=4 {
        let cob_id = u32::from(layout::rpdo1(node)) + 0x100 * u32::from(number - 1);
        dictionary.furnish(Object::rpdo_communication(number, 1), &cob_id.to_le_bytes());
        dictionary.furnish(Object::rpdo_communication(number, 2), &[255]);
        for (sub, object) in [(1, Object::CONTROLWORD), (2, Object::TARGET_TORQUE)] {
            dictionary.furnish(Object::rpdo_mapping(number, sub), &entry(object));
        }
        dictionary.furnish(Object::rpdo_mapping(number, 0), &[2]);
    }
}

/// What a coarse timer makes of a period.
const COARSE_TIMER: Duration = Duration::from_millis(100);
/// From one emergency of a storm to the next.
const STORM: Duration = Duration::from_millis(5);
