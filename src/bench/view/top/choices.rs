//! Choices of the user, which the keys change.

/// Choices of the user.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct View {
    /// Set if the screen is frozen.
    pub(super) is_paused: bool,
    /// Set if the torque budget replaces timing and buses.
    pub(super) is_budget: bool,
}
