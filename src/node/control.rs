//! The controller, and the command mode the operator has chosen.

use crate::link::Link;
use crate::operator::Operator;
use crate::permit::Permit;
use crate::samples::Samples;
use config::Config;
use controller::Controller;
use controller::Input;
use controller::Output;
use controller::switches::Mode as CommandMode;

/// The controller with its command mode.
#[derive(Clone, Debug)]
pub(super) struct Control {
    controller: Controller,
    pub(super) command_mode: CommandMode,
}

impl Control {
    /// Controller and command mode of the configuration.
    pub(super) fn new(config: &Config) -> Self {
        Self { controller: Controller::new(&config.controller), command_mode: config.command_mode }
    }

    /// Input of a step: the drives' positions, the commanded side and the operator. `restart` after a gap.
    pub(super) fn input(
        &self,
        samples: &Samples,
        link: &Link,
        operator: &Operator,
        permit: &Permit,
        restart: bool,
    ) -> Input {
        Input {
            counts: samples.latest().map(|sample| sample.position),
            f_s: link.f_s(),
            x_b_m: link.x_b_m(),
            switches: operator.switches(permit.engaged),
            mode: self.command_mode,
            gravity_share: permit.gravity_share,
            reflection_share: permit.reflection_share,
            restart,
        }
    }

    /// Computes one step.
    pub(super) fn step(&mut self, input: &Input) -> Output {
        self.controller.step(input)
    }
}
