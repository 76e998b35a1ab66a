//! Force/torque sensor in the wrist: its frame {S}, the sign of its reading, and its bias (3.2, Eq. 6).
//!
//! Wrenches here act *on* the tool. A sensor may report the reaction instead, the wrench of the tool on the arm. Its
//! reading includes a bias.

use nalgebra::Isometry3;

use units::spatial::Wrench;

/// Body whose wrench a sensor reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reports {
    /// Wrench on the tool.
    #[default]
    OnTool,
    /// Reaction of the tool on the arm.
    OnArm,
}

/// Six-axis force/torque sensor in the wrist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WristSensor {
    /// Pose of {S} in {MRF}.
    pub x_m_s: Isometry3<f64>,
    /// Body whose wrench the sensor reports, and so the sign of the reading.
    pub reports: Reports,
    /// Reading without load, in N and N·m.
    pub bias: Wrench,
}

impl Default for WristSensor {
    fn default() -> Self {
        Self { x_m_s: Isometry3::identity(), reports: Reports::OnTool, bias: Wrench::ZERO }
    }
}

impl WristSensor {
    /// Simulates the reading with the wrench `f_s` on the tool, at {S}.
    pub fn reading(&self, f_s: &Wrench) -> Wrench {
        self.signed(f_s) + self.bias
    }

    /// Converts a reading to the wrench on the tool, at {S}.
    pub fn on_tool(&self, reading: &Wrench) -> Wrench {
        self.signed(&(*reading - self.bias))
    }

    fn signed(&self, f_s: &Wrench) -> Wrench {
        match self.reports {
            Reports::OnTool => *f_s,
            Reports::OnArm => -*f_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reading_is_undone_for_both_signs() {
        let f_s = Wrench::from_components([1.0, -2.0, 3.0, 0.1, 0.2, -0.3]);
        let bias = Wrench::from_components([0.5, 0.5, -0.5, 0.01, 0.0, 0.02]);
        for reports in [Reports::OnTool, Reports::OnArm] {
            let sensor = WristSensor { reports, bias, ..WristSensor::default() };
            let difference = sensor.on_tool(&sensor.reading(&f_s)) - f_s;
            assert!(difference.components().iter().all(|part| part.abs() < 1e-12));
        }
        let reaction = WristSensor { reports: Reports::OnArm, ..WristSensor::default() };
        assert_eq!(reaction.reading(&f_s), -f_s);
    }
}
