//! What every recording says of its run.

use config::Config;
use telemetry::origin::Origin;

/// Buses, joints and origin of time.
#[derive(Clone, Debug, Default)]
pub struct Provenance {
    /// Interfaces of the buses, in the order of the channels.
    pub(super) interfaces: Vec<String>,
    /// Names of the joints, base first.
    pub(super) joints: Vec<String>,
    /// What all times count from.
    pub(super) origin: Origin,
}

impl Provenance {
    /// A run of `config` on these interfaces.
    pub fn of(config: &Config, interfaces: &[String], origin: Origin) -> Self {
        let joints = config.joints.iter().map(|joint| joint.name.clone()).collect();
        Self { interfaces: interfaces.to_vec(), joints, origin }
    }
}
