//! Acceptance criterion of a case: a reaction, and its time limit from an [expectation](crate::expectation).

use std::time::Duration;

use derive_more::Display;

/// Reaction that a case requires of the node, or of the drives without it.
#[derive(Clone, Copy, Debug, Display, PartialEq)]
pub enum Criterion {
    /// All target torques are zero in time, and the node is latched.
    #[display("all zero and latched within {:.1} ms", millis(*_0))]
    Stop(Duration),
    /// All target torques are zero in time, latched or not.
    #[display("all zero within {:.1} ms", millis(*_0))]
    ZeroTorque(Duration),
    /// No drive exerts torque after this time, by its own timers if necessary.
    #[display("drives torque-free within {:.1} ms", millis(*_0))]
    TorqueFree(Duration),
    /// No drive exerts torque after the first time; the node has abandoned the bus and switched drives off by the second.
    #[display("drives torque-free within {:.1} ms, bus abandoned within {:.1} ms", millis(*_0), millis(*_1))]
    BusAbandoned(Duration, Duration),
    /// Reflection has ended in time, and the node is latched.
    #[display("reflection off and latched within {:.1} ms", millis(*_0))]
    ReflectionOff(Duration),
    /// Reflection has ended in time; the second value says whether the node may stop later.
    #[display("reflection off within {:.1} ms", millis(*_0))]
    Disengaged(Duration, MayStop),
    /// Armed, with joint positions that differ from the true ones by at most this, in rad or m.
    #[display("armed, each position within {:.3} rad (m)", _0)]
    Armed(f64),
    /// Not armed.
    #[display("not armed")]
    Unarmed,
    /// No stop of the node.
    #[display("goes on")]
    GoesOn,
    /// Stop of the node or none, for this reason. No invariant may be violated, and a stop leaves no drive on.
    #[display("stops or goes on: {_0}")]
    Either(&'static str),
}

/// Permission to stop for a node that has disengaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MayStop {
    /// Fault that is equivalent to a released deadman.
    No,
    /// Fault that is more than a released deadman.
    Yes,
}

fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
