//! Classes of the node's modes that the invariants distinguish.

/// Class of a mode of the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeClass {
    /// Latched mode without torque: S2 or S3.
    Stopped,
    /// Command and reflection are enabled.
    Engaged,
    /// Any other mode.
    Other,
}
