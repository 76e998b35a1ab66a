//! `[switches.gripper]` and `[remote.gripper]` as they are written, nothing checked but their types.

use crate::section::sections;
use crate::value::{Optional, Value};

sections! {
    /// The operator's input: `input` with its counts, or two bits.
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

    /// The simulated gripper, with an object or without.
    RemoteGripper {
        stroke_m: Value<f64>,
        max_speed_m_per_s: Value<f64>,
        object_m: Optional<f64>,
        stiffness_n_per_m: Optional<f64>,
    }
}
