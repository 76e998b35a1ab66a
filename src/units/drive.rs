//! Drive units: encoder counts, and per mille of rated torque.

/// Position actual value (6064h), in encoder counts, modulo 2³².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Counts(pub i32);

/// Target torque (6071h) or torque actual value (6077h), in ‰ of the motor's rated torque (6076h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PerMille(pub i16);
