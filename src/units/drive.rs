//! Drive units: encoder counts, and per mille of rated torque.

/// A position of an encoder (6064h), in its counts; wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Counts(pub i32);

/// A target (6071h) or actual (6077h) torque, in ‰ of the motor's rated torque (6076h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PerMille(pub i16);
