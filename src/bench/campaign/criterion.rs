//! The acceptance criterion of one case: a limit of an [expectation](crate::expectation), and what must have
//! happened by then.

use std::time::Duration;

use derive_more::Display;

/// Reaction that a case demands of the node, or of the drives by themselves.
#[derive(Clone, Copy, Debug, Display, PartialEq)]
pub enum Criterion {
    /// All target torques are zero in time, and the node is latched.
    #[display("all zero and latched within {:.1} ms", millis(*_0))]
    Stop(Duration),
    /// All target torques are zero in time; nothing needs to be latched.
    #[display("all zero within {:.1} ms", millis(*_0))]
    ZeroTorque(Duration),
    /// No drive exerts torque, in time, by its own timers if need be.
    #[display("drives torque-free within {:.1} ms", millis(*_0))]
    TorqueFree(Duration),
    /// The same, by the first time; the node switches the drives off and abandons the bus by the second one.
    #[display("drives torque-free within {:.1} ms, bus abandoned within {:.1} ms", millis(*_0), millis(*_1))]
    BusAbandoned(Duration, Duration),
    /// Reflection has ended in time, and the node is latched.
    #[display("reflection off and latched within {:.1} ms", millis(*_0))]
    ReflectionOff(Duration),
    /// Reflection has ended in time; the second value says whether the node may stop later.
    #[display("reflection off within {:.1} ms", millis(*_0))]
    Disengaged(Duration, MayStop),
    /// The node goes on: there is no reason to stop.
    #[display("goes on")]
    GoesOn,
    /// The node may stop or go on, for this reason; no invariant may be violated, and a stop leaves no drive on.
    #[display("stops or goes on: {_0}")]
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

fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
