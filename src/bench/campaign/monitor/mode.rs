//! The modes that the invariants distinguish.

/// Mode of the node, as far as the invariants distinguish it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Torque is taken off by a latched mode.
    Stopped,
    /// Command and reflection are enabled.
    Engaged,
    /// Any other mode.
    Other,
}
