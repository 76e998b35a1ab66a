//! Reactions in words, for those who read the fault table.

use crate::reaction::Decides;
use crate::reaction::Reaction;

/// What is done.
pub const fn of_reaction(reaction: Reaction) -> &'static str {
    match reaction {
        Reaction::None => {
            "nothing: no torque flows that it could harm, but nothing is armed while it is there"
        }
        Reaction::ReflectionOff => {
            "reflection off: the weight of the arm is carried on, the rest ends, the command holds"
        }
        Reaction::ZeroTorque => {
            "zero torque: all six in the next frame, and drives off 100 ms later"
        }
        Reaction::DrivesOff => "drives off: all six torques zero and voltage off in the next frame",
    }
}

/// Who takes the torque away first.
pub const fn of_decides(decides: Decides) -> &'static str {
    match decides {
        Decides::Node => "node",
        Decides::Drive => "drive",
        Decides::Timers => "drives' timers",
    }
}
