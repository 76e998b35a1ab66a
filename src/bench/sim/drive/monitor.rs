//! Monitored quantities of a drive, and their faults and warnings. The [power state machine](super::power) reacts.

use crate::drive::inputs::Inputs;
use canopen::error_codes;

/// Monitored quantities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Monitor {
    /// Winding temperature, in °C.
    pub(super) temperature: f64,
    /// DC link voltage, in V.
    pub(super) link_voltage: f64,
    /// Digital inputs.
    pub(super) inputs: Inputs,
    /// Set if the motor exceeds its trip speed.
    pub(super) is_too_fast: bool,
}

impl Default for Monitor {
    /// Returns a cold drive at nominal voltage with all inputs low.
    fn default() -> Self {
        Self {
            temperature: 0.0,
            link_voltage: NOMINAL_VOLTAGE,
            inputs: Inputs::default(),
            is_too_fast: false,
        }
    }
}

/// Cause of the Fault state (CiA 402), most severe first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FaultCause {
    SafeTorqueOff,
    UnderVoltage,
    OverVoltage,
    OverTemperature,
    OverSpeed,
}

impl FaultCause {
    /// Returns the error code of 603Fh and the EMCY.
    pub(super) const fn error_code(self) -> u16 {
        match self {
            Self::SafeTorqueOff => error_codes::SAFE_TORQUE_OFF,
            Self::UnderVoltage => error_codes::UNDER_VOLTAGE,
            Self::OverVoltage => error_codes::OVER_VOLTAGE,
            Self::OverTemperature => error_codes::OVER_TEMPERATURE,
            Self::OverSpeed => error_codes::OVER_SPEED,
        }
    }

    /// Returns whether the drive cannot brake the motor, so that 605Eh does not apply.
    pub(super) const fn is_torque_gone(self) -> bool {
        match self {
            Self::SafeTorqueOff | Self::UnderVoltage => true,
            Self::OverVoltage | Self::OverTemperature | Self::OverSpeed => false,
        }
    }
}

impl Monitor {
    /// Returns the most severe cause present.
    pub(super) fn cause(&self) -> Option<FaultCause> {
        let causes = [
            (self.inputs.is_torque_off, FaultCause::SafeTorqueOff),
            (self.link_voltage < MIN_VOLTAGE, FaultCause::UnderVoltage),
            (self.link_voltage > MAX_VOLTAGE, FaultCause::OverVoltage),
            (self.temperature >= MAX_TEMPERATURE, FaultCause::OverTemperature),
            (self.is_too_fast, FaultCause::OverSpeed),
        ];
        causes.into_iter().find_map(|(is_present, cause)| is_present.then_some(cause))
    }

    /// Returns whether the winding is near its limit (statusword bit 7).
    pub(super) fn has_warning(&self) -> bool {
        self.temperature >= MAX_TEMPERATURE - WARNING_MARGIN
    }

    /// Returns whether the power stage has voltage (statusword bit 4).
    pub(super) fn has_voltage(&self) -> bool {
        self.link_voltage >= MIN_VOLTAGE && !self.inputs.is_torque_off
    }
}

/// Nominal DC link voltage, in V.
const NOMINAL_VOLTAGE: f64 = 48.0;
/// Under-voltage limit of the DC link, in V.
const MIN_VOLTAGE: f64 = 36.0;
/// Over-voltage limit of the DC link, in V.
const MAX_VOLTAGE: f64 = 60.0;
/// Over-temperature limit of the winding, in °C.
const MAX_TEMPERATURE: f64 = 120.0;
/// Distance of the warning from the over-temperature limit, in K.
const WARNING_MARGIN: f64 = 10.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn at(temperature: f64) -> Monitor {
        Monitor { temperature, ..Monitor::default() }
    }

    #[test]
    fn temperature_warns_before_it_faults() {
        for (temperature, has_warning, cause) in [
            (25.0, false, None),
            (109.9, false, None),
            (110.0, true, None),
            (120.0, true, Some(FaultCause::OverTemperature)),
        ] {
            assert_eq!(at(temperature).has_warning(), has_warning, "{temperature} °C");
            assert_eq!(at(temperature).cause(), cause, "{temperature} °C");
        }
    }

    #[test]
    fn most_severe_cause_comes_first() {
        let mut monitor = Monitor { is_too_fast: true, ..at(130.0) };
        assert_eq!(monitor.cause(), Some(FaultCause::OverTemperature));
        monitor.link_voltage = 70.0;
        assert_eq!(monitor.cause(), Some(FaultCause::OverVoltage));
        monitor.inputs.is_torque_off = true;
        assert_eq!(monitor.cause(), Some(FaultCause::SafeTorqueOff));
        assert!(!monitor.has_voltage());
    }

    #[test]
    fn error_codes_have_descriptions() {
        for (cause, words) in [
            (FaultCause::SafeTorqueOff, "safe torque off"),
            (FaultCause::UnderVoltage, "DC link under-voltage"),
            (FaultCause::OverVoltage, "DC link over-voltage"),
            (FaultCause::OverTemperature, "drive temperature too high"),
            (FaultCause::OverSpeed, "speed"),
        ] {
            assert_eq!(error_codes::description(cause.error_code()), words);
        }
    }
}
