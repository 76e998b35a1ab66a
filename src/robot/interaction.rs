//! Interaction of an arm with its environment: contact wrench without payload, accommodation, and the wrench for the
//! operator.
//!
//! ```text
//!  reading ── sign, bias ──► f_s ── payload ──► contact at {S} ──► {MRF} ── K_FA ──► + S v_operator + (I - S) v_auto
//! ```
//!
//! Accommodation excludes the payload, whose weight would otherwise draw the arm down. `feels_payload` includes it in the
//! wrench for the operator.

use nalgebra::{Isometry3, Vector3};

use crate::accommodation::Accommodation;
use crate::payload::{Payload, SensorMotion};
use crate::shared_control::SharedControl;
use crate::wrist_sensor::WristSensor;
use units::spatial::{Twist, Wrench};

/// Parameters of sensor, payload, accommodation and shared control.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interaction {
    /// Pose, sign and bias of the sensor at {S}.
    pub sensor: WristSensor,
    /// Body between sensor and contact.
    pub payload: Payload,
    /// Gravity in the base, in m/s².
    pub gravity_in_b: Vector3<f64>,
    /// Removes the inertia of the payload in addition to its weight.
    pub removes_inertia: bool,
    /// Includes the payload in the wrench for the operator.
    pub feels_payload: bool,
    /// K_FA and its deadband (4.3).
    pub accommodation: Accommodation,
    /// Share of the operator on each axis.
    pub shared: SharedControl,
}

/// Pose and motion of {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolState {
    /// Pose of {MRF} in the base.
    pub x_b_m: Isometry3<f64>,
    /// Twist of {MRF}, written in {MRF}.
    pub v_m: Twist,
    /// Rate of change of the twist's components, in m/s² and rad/s².
    pub v_dot_m: Twist,
}

impl ToolState {
    /// Returns a tool without motion, with {MRF} at `x_b_m` in the base.
    pub const fn at_rest(x_b_m: Isometry3<f64>) -> Self {
        Self { x_b_m, v_m: Twist::ZERO, v_dot_m: Twist::ZERO }
    }
}

impl Interaction {
    /// Simulates the reading of the sensor with the contact wrench `f_m_contact` on the tool.
    pub fn reading(&self, tool: &ToolState, f_m_contact: &Wrench) -> Wrench {
        let f_s = f_m_contact.at(&self.sensor.x_m_s.inverse()) + self.load(tool);
        self.sensor.reading(&f_s)
    }

    /// Removes the payload from a reading; returns the contact wrench at {S} (decision 8).
    pub fn contact(&self, tool: &ToolState, reading: &Wrench) -> Wrench {
        self.sensor.on_tool(reading) - self.load(tool)
    }

    /// Converts a reading to the wrench for the operator, at {S}.
    pub fn operator_wrench(&self, tool: &ToolState, reading: &Wrench) -> Wrench {
        if self.feels_payload { self.sensor.on_tool(reading) } else { self.contact(tool, reading) }
    }

    /// Computes the rate of {MRF} from a commanded rate, with shared control and accommodation to `f_m_contact`.
    pub fn rate(&self, v_m_commanded: &Twist, f_m_contact: &Wrench) -> Twist {
        self.accommodation.rate(&self.shared.rate(v_m_commanded), f_m_contact)
    }

    /// Computes the load of the payload on the sensor, at {S}.
    fn load(&self, tool: &ToolState) -> Wrench {
        let x_b_s = tool.x_b_m * self.sensor.x_m_s;
        if self.removes_inertia {
            let x_s_m = self.sensor.x_m_s.inverse();
            let moving =
                SensorMotion { v_s: tool.v_m.at(&x_s_m), v_dot_s: tool.v_dot_m.at(&x_s_m) };
            self.payload.load(&x_b_s, &self.gravity_in_b, &moving)
        } else {
            self.payload.weight(&x_b_s, &self.gravity_in_b)
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::wrist_sensor::Reports;

    fn six(size: f64) -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(-size..size)
    }

    fn pose([x, y, z, a, b, c]: [f64; 6]) -> Isometry3<f64> {
        Isometry3::new([x, y, z].into(), [a, b, c].into())
    }

    fn interaction(x_m_s: [f64; 6], feels_payload: bool) -> Interaction {
        let payload = Payload::new(1.5, [0.0, 0.01, 0.04]).unwrap();
        Interaction {
            sensor: WristSensor {
                x_m_s: pose(x_m_s),
                reports: Reports::OnArm,
                bias: Wrench::from_components([1.0, 2.0, -3.0, 0.1, 0.2, -0.3]),
            },
            payload: payload.with_inertia([0.01, 0.02, 0.015, 0.0, 0.0, 0.0]).unwrap(),
            gravity_in_b: Vector3::new(0.0, 0.0, -9.81),
            removes_inertia: true,
            feels_payload,
            ..Interaction::default()
        }
    }

    proptest! {
        #[test]
        fn contact_is_left_of_the_reading(
            x_b_m in six(1.0), x_m_s in six(1.0), v in six(2.0), a in six(9.0), f in six(50.0)
        ) {
            let tool = ToolState {
                x_b_m: pose(x_b_m),
                v_m: Twist::from_components(v),
                v_dot_m: Twist::from_components(a),
            };
            let f_m = Wrench::from_components(f);
            for feels_payload in [false, true] {
                let made = interaction(x_m_s, feels_payload);
                let reading = made.reading(&tool, &f_m);
                let left = made.contact(&tool, &reading).at(&made.sensor.x_m_s) - f_m;
                prop_assert!(left.components().iter().all(|part| part.abs() < 1e-9), "{left:?}");
                let felt = made.operator_wrench(&tool, &reading) - made.contact(&tool, &reading);
                prop_assert_eq!(felt.force.norm() > 1e-9, feels_payload);
            }
        }
    }

    #[test]
    fn accommodation_is_added_to_shared_control() {
        let made = Interaction {
            accommodation: Accommodation::new([0.01; 6], [0.0; 6]).unwrap(),
            shared: SharedControl::new([0.0; 6], [0.0; 6]).unwrap(),
            ..Interaction::default()
        };
        let push = Wrench::from_components([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let v_m = made.rate(&Twist::from_components([1.0; 6]), &push);
        assert_eq!(v_m, Twist::from_components([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]));
    }
}
