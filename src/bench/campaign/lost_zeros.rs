//! Arm of a case whose drives lose their zero with the power, and may lie beside its rest posture.

use std::io;

use config::Config;
use config::files::Files;
use config::trust::Trust;
use config::zeroing::Zeroing;
use testbench::lost_zero::{self, LostZero};
use toml::Table;
use units::numbering::Joint;

/// Other zeros than those of the file, and where the arm lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LostZeros {
    /// Kind of the zeros.
    pub kind: LostZero,
    /// Joint that lies beside its rest position, and by how much, in rad or m.
    pub miss: Option<(Joint, f64)>,
}

impl LostZeros {
    /// Returns the files of a configuration with these zeros.
    ///
    /// # Errors
    /// When the file cannot be read, or is not TOML.
    pub fn files(&self, config: &Config) -> io::Result<Files> {
        let files = Files::on_disk(Trust::Any);
        let text = String::from_utf8_lossy(&files.read(&config.file)?).into_owned();
        let text = self.kind.set_in(&text, may_be_lost).map_err(io::Error::other)?;
        let text = match self.miss {
            Some(miss) => lost_zero::laid_beside(&text, miss).map_err(io::Error::other)?,
            None => text,
        };
        Ok(files.with(&config.file, text.into_bytes()))
    }
}

/// Returns whether the zero of a joint may be lost: nothing of it is stated only, which a second rest posture would verify.
fn may_be_lost(joint: &Table) -> bool {
    let is_resting = ["rest_deg", "rest_m"].iter().any(|key| joint.contains_key(*key));
    is_resting && !joint.contains_key("accept_stated_only")
}

/// Returns the joints whose zero may be lost.
pub(super) fn joints(config: &Config) -> Vec<Joint> {
    let all = Joint::each(&config.joints);
    all.filter(|(_, joint)| joint.rest.is_some() && joint.accepted.is_empty())
        .map(|(joint, _)| joint)
        .collect()
}

/// Returns the joints among them that no coupling ties to another.
pub(super) fn single_joints(config: &Config) -> Vec<Joint> {
    let zeroing = Zeroing::new(config);
    let is_single =
        |joint: &Joint| zeroing.group(*joint).iter().filter(|is_tied| **is_tied).count() == 1;
    joints(config).into_iter().filter(is_single).collect()
}

/// Returns a motor revolution at a joint, in rad or m.
pub(super) fn revolution(config: &Config, joint: Joint) -> f64 {
    let parameters = joint.entry(&config.joints);
    f64::from(parameters.plant.actuator.counts_per_rev) * parameters.calibration.quantum()
}

/// Returns `by`, in rad or m, or its opposite, if a joint has room for it beside its rest position.
pub(super) fn with_room(config: &Config, joint: Joint, by: f64) -> Option<f64> {
    let parameters = joint.entry(&config.joints);
    let [low, high] = parameters.plant.link.range;
    let rest = parameters.rest?.position();
    [by, -by].into_iter().find(|by| (low..=high).contains(&(rest + by)))
}
