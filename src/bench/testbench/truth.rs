//! Ground truth at the hand: the wrench between grip and hand in the simulated world, with its parts.
//!
//! At a SYNC the drives have held the torque of two cycles ago for one period (CiA 301, 7.2.2.5.1). The wrench on the
//! hand at that time is compared with K_T times the wrench sensed two cycles ago, and with that torque's parts.

use crate::bench::Bench;
use bus::Tap;
use config::Config;
use controller::torque_delay::TorqueDelay;
use inputs::InputSink;
use node::record::Record;
use telemetry::fidelity::command::AtGrip;
use telemetry::fidelity::{CommandSampler, Sample, WrenchParts};

/// Samples of the ground truth at the hand.
#[derive(Clone, Debug)]
pub struct Truth {
    commanded: CommandSampler,
    /// Commanded samples of the last two cycles.
    delay: TorqueDelay<Option<Sample>>,
}

impl Truth {
    /// Creates the measurement for a bench of `config`.
    pub fn new(config: &Config) -> Self {
        Self { commanded: CommandSampler::new(&config.controller), delay: TorqueDelay::new(None) }
    }

    /// Returns the sample of the cycle that `bench` has just run; `None` while reflection is off or ramps.
    pub fn sample<T: Tap, S: InputSink + Clone>(
        &mut self,
        bench: &Bench<T, S>,
        record: &Record,
    ) -> Option<Sample> {
        let acted = self.delay.acted();
        self.delay.push(self.commanded.sample(record));
        let acted = acted?;
        let plant = bench.world().plant();
        let j_g = plant.jacobian();
        let at_grip = AtGrip::new(&j_g)?;
        let balance = plant.balance(&j_g);
        Some(Sample {
            at: record.at,
            x_0: plant.x_0_g().translation.vector,
            felt: *plant.f_g_hand() * -1.0,
            parts: WrenchParts {
                friction: at_grip.wrench(&balance.resisting),
                inertia: at_grip.wrench(&balance.inertia) * -1.0,
                ..acted.parts
            },
            ..acted
        })
    }
}
