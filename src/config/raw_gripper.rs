//! Keys of `[switches.gripper]` and `[remote.gripper]`, checked for their types only.

use crate::section::sections;
use crate::value::{Optional, Value};

sections! {
    /// Input of the operator: `input` with its counts, or two bits.
    SwitchesGripper {
        input: Optional<u8>,
        open_counts: Optional<i16>,
        closed_counts: Optional<i16>,
        open_bit: Optional<u8>,
        close_bit: Optional<u8>,
        stroke_m: Value<f64>,
        force_n: Value<f64>,
        max_speed_m_per_s: Value<f64>,
    }

    /// Simulated gripper, with or without an object.
    RemoteGripper {
        stroke_m: Value<f64>,
        max_speed_m_per_s: Value<f64>,
        object_m: Optional<f64>,
        stiffness_n_per_m: Optional<f64>,
    }
}
