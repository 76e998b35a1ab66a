//! What a drive counts in: encoder counts, and thousandths of a motor's rated torque.

/// A position of an encoder (6064h), in its counts; wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Counts(pub i32);

/// A torque as a drive takes it (6071h) or gives it (6077h): thousandths of the motor's rated torque (6076h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PerMille(pub i16);
