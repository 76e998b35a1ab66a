//! Status of the gripper, as commanded and as the commanded side reports it.

use serde::Serialize;

use node::record::GripperRecord;
use remote::Gripper;

/// Opening and force of a gripper, commanded and measured; `None` where there is no value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GripperStatus {
    /// State in words. Nothing is commanded before the commanded side has reported its gripper.
    pub state: &'static str,
    /// Commanded opening, in m.
    pub commanded_m: Option<f64>,
    /// Maximum force commanded, in N.
    pub max_force_n: Option<f64>,
    /// Opening that the commanded side reports, in m.
    pub opening_m: Option<f64>,
    /// Force that the commanded side reports, in N.
    pub force_n: Option<f64>,
}

impl GripperStatus {
    /// Returns the status of a cycle from its record.
    pub fn from_record(GripperRecord { command, measured }: GripperRecord) -> Self {
        let state = match (command, measured) {
            (None, None) => "the commanded side reports none",
            (None, Some(_)) => "not commanded before the deadman is pressed",
            (Some(_), None) => "commanded; the commanded side reports none",
            (Some(_), Some(_)) => "commanded",
        };
        let position = |Gripper { position, .. }| position;
        let force = |Gripper { force, .. }| force;
        Self {
            state,
            commanded_m: command.map(position),
            max_force_n: command.map(force),
            opening_m: measured.map(position),
            force_n: measured.map(force),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gripper_of_the_commanded_side_may_be_absent() {
        let gripper = Some(Gripper { position: 0.03, force: 12.0 });
        for (command, measured, state) in [
            (None, None, "the commanded side reports none"),
            (None, gripper, "not commanded before the deadman is pressed"),
            (gripper, None, "commanded; the commanded side reports none"),
            (gripper, gripper, "commanded"),
        ] {
            let status = GripperStatus::from_record(GripperRecord { command, measured });
            assert_eq!(status.state, state);
            assert_eq!(status.commanded_m, command.map(|it| it.position));
            assert_eq!(status.force_n, measured.map(|it| it.force));
        }
    }
}
