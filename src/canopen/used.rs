//! Objects that the master or the node uses if a device has them. An EDS that lists one of them must describe it.

use crate::nameplate::Nameplate;
use crate::object::Object;
use crate::plan::NodePlan;

/// Communication parameters of all PDOs, which the boot configures or switches off: 1400h to 1BFFh.
const PDO_PARAMETERS: std::ops::RangeInclusive<u16> = 0x1400..=0x1BFF;

/// Objects of any device that are read or written if present.
const OF_ANY_DEVICE: [Object; 12] = [
    Object::DEVICE_TYPE,
    Object::ERROR_REGISTER,
    Object::ERROR_HISTORY,
    Object::CYCLE_PERIOD,
    Object::GUARD_TIME,
    Object::LIFE_TIME_FACTOR,
    Object::RESTORE_DEFAULTS,
    Object::EMCY_COB_ID,
    Object::CONSUMER_HEARTBEAT,
    Object::PRODUCER_HEARTBEAT,
    Object::VENDOR_ID,
    Object::ERROR_BEHAVIOUR,
];

/// Objects of a drive that are read or written if present, besides those of its nameplate and its plan.
const OF_A_DRIVE: [Object; 17] = [
    Object::ABORT_CONNECTION,
    Object::CONTROLWORD,
    Object::STATUSWORD,
    Object::QUICK_STOP_OPTION,
    Object::SHUTDOWN_OPTION,
    Object::DISABLE_OPERATION_OPTION,
    Object::HALT_OPTION,
    Object::FAULT_REACTION,
    Object::MODE_OF_OPERATION,
    Object::MODE_DISPLAY,
    Object::POSITION_ACTUAL,
    Object::TARGET_TORQUE,
    Object::MAX_TORQUE,
    Object::TORQUE_DEMAND,
    Object::TORQUE_ACTUAL,
    Object::MAX_MOTOR_SPEED,
    Object::INTERPOLATION_TIME,
];

impl NodePlan {
    /// Returns whether objects at `index` are used if the node has them.
    pub fn uses(&self, index: u16) -> bool {
        let is_it = |object: &Object| object.index == index;
        let is_of_drive = || OF_A_DRIVE.iter().chain(&Nameplate::OBJECTS).any(is_it);
        PDO_PARAMETERS.contains(&index)
            || OF_ANY_DEVICE.iter().any(is_it)
            || self.is_drive() && is_of_drive()
            || self.settings().iter().any(|setting| is_it(&setting.check.object))
            || self.demands().any(|object| is_it(&object))
    }
}
