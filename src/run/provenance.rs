//! Metadata of a run, which every recording contains.

use std::path::Path;

use config::Config;
use telemetry::origin::Origin;
use telemetry::status::{self, JointLabel};

/// Buses, joints and origin of time.
#[derive(Clone, Debug, Default)]
pub struct Provenance {
    /// SocketCAN interfaces of the buses, in the order of the channels.
    pub(super) interfaces: Vec<String>,
    /// Names and units of the joints, base first.
    pub(super) joints: Vec<JointLabel>,
    /// Origin of all times of the run.
    pub(super) origin: Origin,
    /// Name of the session's folder, if one is recorded.
    pub(super) session: Option<String>,
}

impl Provenance {
    /// Returns the metadata of a run of `config` on these interfaces.
    pub fn new(config: &Config, interfaces: &[String], origin: Origin) -> Self {
        Self {
            interfaces: interfaces.to_vec(),
            joints: status::labels(config),
            origin,
            session: None,
        }
    }

    /// Adds the name of a session's folder, without the path to it.
    pub(super) fn in_session(&self, folder: &Path) -> Self {
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
        let name = folder.file_name().map(|name| name.to_string_lossy().into_owned());
        Self { session: name, ..self.clone() }
    }

    /// Returns the names of the joints, base first.
    pub(super) fn joint_names(&self) -> Vec<&str> {
        self.joints.iter().map(|joint| joint.name.as_str()).collect()
    }
}
