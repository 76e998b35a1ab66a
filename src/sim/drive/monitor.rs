//! What a drive watches of itself, and when it takes what it sees for a fault or a warning.
//!
//! Not what it does about it: that is the [power stage's](super::power).

use crate::drive::inputs::Inputs;
use canopen::error_codes;

/// What it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Monitor {
    /// Of the winding, in °C.
    pub(super) temperature: f64,
    /// Of the DC link, in V.
    pub(super) link_voltage: f64,
    /// Its terminals.
    pub(super) inputs: Inputs,
    /// Whether the motor is faster than it may be.
    pub(super) is_too_fast: bool,
}

impl Default for Monitor {
    /// Cold, at its nominal voltage, with nothing at its terminals.
    fn default() -> Self {
        Self {
            temperature: 0.0,
            link_voltage: NOMINAL,
            inputs: Inputs::default(),
            is_too_fast: false,
        }
    }
}

/// Why a drive gives up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    SafeTorqueOff,
    UnderVoltage,
    OverVoltage,
    OverTemperature,
    OverSpeed,
}

impl Cause {
    /// What 603Fh and the emergency say.
    pub(super) const fn error_code(self) -> u16 {
        match self {
            Self::SafeTorqueOff => error_codes::SAFE_TORQUE_OFF,
            Self::UnderVoltage => error_codes::UNDER_VOLTAGE,
            Self::OverVoltage => error_codes::OVER_VOLTAGE,
            Self::OverTemperature => error_codes::OVER_TEMPERATURE,
            Self::OverSpeed => error_codes::OVER_SPEED,
        }
    }

    /// Whether there is nothing left to stop the motor with, whatever 605Eh says.
    pub(super) const fn is_torque_gone(self) -> bool {
        match self {
            Self::SafeTorqueOff | Self::UnderVoltage => true,
            Self::OverVoltage | Self::OverTemperature | Self::OverSpeed => false,
        }
    }
}

impl Monitor {
    /// What is wrong now, the worst of it.
    pub(super) fn cause(&self) -> Option<Cause> {
        let causes = [
            (self.inputs.is_torque_off, Cause::SafeTorqueOff),
            (self.link_voltage < LOWEST, Cause::UnderVoltage),
            (self.link_voltage > HIGHEST, Cause::OverVoltage),
            (self.temperature >= HOTTEST, Cause::OverTemperature),
            (self.is_too_fast, Cause::OverSpeed),
        ];
        causes.into_iter().find_map(|(is_so, cause)| is_so.then_some(cause))
    }

    /// Whether it soon will be too hot (bit 7 of the statusword).
    pub(super) fn has_warning(&self) -> bool {
        self.temperature >= HOTTEST - MARGIN
    }

    /// Whether the power stage has its voltage (bit 4 of the statusword).
    pub(super) fn has_voltage(&self) -> bool {
        self.link_voltage >= LOWEST && !self.inputs.is_torque_off
    }
}

/// Of the DC link, in V.
const NOMINAL: f64 = 48.0;
/// Of the DC link, in V.
const LOWEST: f64 = 36.0;
/// Of the DC link, in V.
const HIGHEST: f64 = 60.0;
/// Of the winding, in °C.
const HOTTEST: f64 = 120.0;
/// So far below the limit it is told, in K.
const MARGIN: f64 = 10.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn at(temperature: f64) -> Monitor {
        Monitor { temperature, ..Monitor::default() }
    }

    #[test]
    fn heat_is_told_before_it_is_a_fault() {
        for (temperature, has_warning, cause) in [
            (25.0, false, None),
            (109.9, false, None),
            (110.0, true, None),
            (120.0, true, Some(Cause::OverTemperature)),
        ] {
            assert_eq!(at(temperature).has_warning(), has_warning, "{temperature} °C");
            assert_eq!(at(temperature).cause(), cause, "{temperature} °C");
        }
    }

    #[test]
    fn the_worst_is_told_first() {
        let mut monitor = Monitor { is_too_fast: true, ..at(130.0) };
        assert_eq!(monitor.cause(), Some(Cause::OverTemperature));
        monitor.link_voltage = 70.0;
        assert_eq!(monitor.cause(), Some(Cause::OverVoltage));
        monitor.inputs.is_torque_off = true;
        assert_eq!(monitor.cause(), Some(Cause::SafeTorqueOff));
        assert!(!monitor.has_voltage());
    }

    #[test]
    fn every_code_has_a_class_with_words() {
        for (cause, words) in [
            (Cause::SafeTorqueOff, "safe torque off"),
            (Cause::UnderVoltage, "DC link under-voltage"),
            (Cause::OverVoltage, "DC link over-voltage"),
            (Cause::OverTemperature, "drive temperature too high"),
            (Cause::OverSpeed, "speed"),
        ] {
            assert_eq!(error_codes::words(cause.error_code()), words);
        }
    }
}
