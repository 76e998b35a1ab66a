//! The acceptance criterion of one case: a limit of an [expectation](crate::expectation), and what must have
//! happened by then.

use std::fmt;
use std::time::Duration;

/// Reaction that a case demands of the node, or of the drives by themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Criterion {
    /// All target torques are zero in time, and the node is latched.
    Stop(Duration),
    /// All target torques are zero in time; nothing needs to be latched.
    ZeroTorque(Duration),
    /// No drive exerts torque, in time, by its own timers if need be.
    TorqueFree(Duration),
    /// The same, by the first time; the node switches the drives off and abandons the bus by the second one.
    BusAbandoned(Duration, Duration),
    /// Reflection has ended in time, and the node is latched.
    ReflectionOff(Duration),
    /// Reflection has ended in time; the second value says whether the node may stop later.
    Disengaged(Duration, MayStop),
    /// The node goes on: there is no reason to stop.
    GoesOn,
    /// The node may stop or go on, for this reason; no invariant may be violated, and a stop leaves no drive on.
    Either(&'static str),
}

/// Permission to stop for a node that has disengaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MayStop {
    /// There is no reason to stop.
    No,
    /// The fault is more than a released deadman.
    Yes,
}

/// As in `all zero and latched within 5.0 ms`.
impl fmt::Display for Criterion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millis = |time: &Duration| time.as_secs_f64() * 1e3;
        match self {
            Self::Stop(within) => write!(f, "all zero and latched within {:.1} ms", millis(within)),
            Self::ZeroTorque(within) => write!(f, "all zero within {:.1} ms", millis(within)),
            Self::TorqueFree(within) => {
                write!(f, "drives torque-free within {:.1} ms", millis(within))
            }
            Self::BusAbandoned(within, abandoned) => write!(
                f,
                "drives torque-free within {:.1} ms, bus abandoned within {:.1} ms",
                millis(within),
                millis(abandoned)
            ),
            Self::ReflectionOff(within) => {
                write!(f, "reflection off and latched within {:.1} ms", millis(within))
            }
            Self::Disengaged(within, _) => {
                write!(f, "reflection off within {:.1} ms", millis(within))
            }
            Self::GoesOn => f.write_str("goes on"),
            Self::Either(why) => write!(f, "stops or goes on: {why}"),
        }
    }
}
