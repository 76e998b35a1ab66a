//! State of a zero, and why it is unknown.

use derive_more::Display;
use thiserror::Error;

use config::rest::Rest;
use units::numbering::Joint;
use units::wording::in_one_line;

/// State of a joint's zero.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum ZeroState {
    /// Its position is known.
    #[display("zero known")]
    Known,
    /// Its position is not known, for this reason.
    #[display("zero unknown: {_0}")]
    Unknown(UnknownZero),
}

/// Reason why a zero is unknown.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum UnknownZero {
    /// Not set since the start of the node, which was not watching before.
    #[display("not set since the node started")]
    NotSet,
    /// Reset of the drive by the node, or a boot after a time in which it did not watch.
    #[display("the node has reset the drive")]
    Reset,
    /// Boot-up message of the drive.
    #[display("the drive has rebooted")]
    Rebooted,
    /// Heartbeat or answer to guarding lost.
    #[display("the heartbeat of the drive was lost")]
    HeartbeatLost,
    /// Several samples missing in a row.
    #[display("position samples were missing")]
    SamplesMissing,
    /// Emergency of a sensor (73xxh).
    #[display("sensor fault, emergency {code:04X}h")]
    SensorFault {
        /// Error code.
        code: u16,
    },
    /// Bit of the statusword by which the drive says that it knows its home.
    #[display("the drive does not know its home (referenced_bit of 6041h is 0)")]
    NotReferenced,
    /// Position beyond what the joint can move.
    #[display("the position jumped")]
    Jumped,
    /// Set by the rest posture, whose reading fits with any sign and scale.
    #[display("not verified by the second rest position")]
    NotVerified,
}

/// Joints whose zero is unknown, which forbids arming.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}", in_one_line(.0))]
pub struct UnknownZeros(pub(super) Vec<UnknownJoint>);

/// Joint whose zero is unknown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct UnknownJoint {
    pub(super) joint: Joint,
    pub(super) name: String,
    pub(super) why: UnknownZero,
    /// Position in rad or m, and the second rest position, if that is awaited.
    pub(super) awaited: Option<(f64, Rest)>,
}

/// `joint 3 (elbow): zero unknown: the drive has rebooted; lay the arm in its rest posture, then frhc ctl zero`
impl std::fmt::Display for UnknownJoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { joint, name, why, awaited } = self;
        write!(f, "joint {joint} ({name}): zero unknown: {why}; ")?;
        match awaited {
            Some((q, rest)) => {
                let (reading, key) = (rest.format(*q), rest.key());
                write!(
                    f,
                    "reads {reading}, second_{key} is {rest}: move it there by hand at zero torque, or correct sign and scale"
                )
            }
            None => {
                write!(f, "lay the arm in its rest posture, then `frhc ctl zero --joint {name}`")
            }
        }
    }
}
