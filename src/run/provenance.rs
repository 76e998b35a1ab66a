//! Metadata that every recording of a run contains.

use config::Config;
use telemetry::origin::Origin;

/// Buses, joints and origin of time.
#[derive(Clone, Debug, Default)]
pub struct Provenance {
    /// SocketCAN interfaces of the buses, in the order of the channels.
    pub(super) interfaces: Vec<String>,
    /// Names of the joints, base first.
    pub(super) joints: Vec<String>,
    /// Time from which all times of the run count.
    pub(super) origin: Origin,
}

impl Provenance {
    /// Returns the metadata of a run of `config` on these interfaces.
    pub fn of(config: &Config, interfaces: &[String], origin: Origin) -> Self {
        let joints = config.joints.iter().map(|joint| joint.name.clone()).collect();
        Self { interfaces: interfaces.to_vec(), joints, origin }
    }
}
