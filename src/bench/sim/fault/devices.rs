//! Devices to which faults are applied.

use crate::fault::breakable::Breakable;
use units::numbering::NodeIndex;

/// Six drives and the switch box; `None` for a device that is not on the buses.
pub type Devices<'a> = [Option<&'a mut dyn Breakable>; 7];

/// Returns the devices on the buses, with their indices.
pub(crate) fn present<'d, 'a>(
    devices: &'d mut Devices<'a>,
) -> impl Iterator<Item = (NodeIndex, &'d mut (dyn Breakable + 'a))> {
    let all = NodeIndex::each(devices);
    all.filter_map(|(place, device)| Some((place, &mut **device.as_mut()?)))
}
