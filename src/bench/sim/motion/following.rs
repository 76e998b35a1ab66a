//! Following error monitoring (CiA 402-2: 6065h, 6066h).

use crate::motion::axis::{Axis, StepInput};
use crate::motion::condition_timer::ConditionTimer;
use canopen::object::Object;

/// Monitor of the following error.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Following(ConditionTimer);

impl Following {
    /// Returns whether the following error has exceeded its window (6065h) for its time (6066h).
    pub(super) fn is_lost(&mut self, axis: &Axis, input: &StepInput<'_>) -> bool {
        let window = input.dictionary.optional(Object::FOLLOWING_ERROR_WINDOW).unwrap_or(NO_WINDOW);
        let is_outside =
            window != NO_WINDOW && axis.following_error(input).abs() > f64::from(window);
        let time = input.dictionary.unsigned(Object::FOLLOWING_ERROR_TIME);
        self.0.has_lasted(input.dt, is_outside, time)
    }
}

/// Value of 6065h and 6067h that disables the window.
pub(super) const NO_WINDOW: u32 = u32::MAX;
