//! Whether the motor follows its demand (CiA 402-2: 6065h, 6066h).

use crate::motion::axis::Axis;
use crate::motion::axis::Moment;
use crate::motion::lasting::Lasting;
use canopen::object::Object;

/// A watch on the following error.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Following(Lasting);

impl Following {
    /// Whether the motor has been outside the window for longer than it may.
    pub(super) fn is_lost(&mut self, axis: &Axis, moment: &Moment<'_>) -> bool {
        let window = moment.dictionary.unsigned(Object::FOLLOWING_ERROR_WINDOW);
        let is_outside = window != NO_WINDOW && axis.behind(moment).abs() > f64::from(window);
        let time = moment.dictionary.unsigned(Object::FOLLOWING_ERROR_TIME);
        self.0.has_lasted(moment.dt, is_outside, time)
    }
}

/// A window of this size is none (6065h, 6067h).
pub(super) const NO_WINDOW: u32 = u32::MAX;
