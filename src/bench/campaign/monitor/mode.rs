//! Modes of the node that the invariants distinguish.

/// Mode of the node, as far as the invariants distinguish it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Latched mode without torque: S2 or S3.
    Stopped,
    /// Command and reflection are enabled.
    Engaged,
    /// Any other mode.
    Other,
}
