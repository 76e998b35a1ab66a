//! Rest posture: the first arming after a boot verifies sign and scale of positions that no object of a drive does.
//!
//! Until then no torque acts, so a wrong factor or zero moves nothing. Later armings may start anywhere: a drive that loses its
//! position reboots, and that stops the node.

use derive_more::Display;
use thiserror::Error;

use config::Config;
use config::rest::Rest;
use controller::JointVector;
use units::numbering::Joint;
use units::wording::in_one_line;

/// Rest posture of the arm, and whether the arm was in it.
#[derive(Clone, Debug)]
pub(super) struct RestPosture {
    rests: [Option<Rest>; 6],
    is_confirmed: bool,
}

/// Joints that are not at rest at the first arming after a boot.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "{}: at the first arming after a boot the arm must rest; bring it there, or correct the sign of gear_ratio, \
     encoder_counts_per_rev or zero_counts of the joint",
    in_one_line(.0)
)]
pub struct NotAtRest(Vec<Reading>);

/// Reading of a joint that is not at rest.
#[derive(Clone, Debug, Display, PartialEq)]
#[display("joint {joint} ({name}): reads {}, {} is {rest}", rest.format(*q), rest.key())]
struct Reading {
    joint: Joint,
    name: String,
    rest: Rest,
    /// In rad or m.
    q: f64,
}

impl RestPosture {
    /// Returns the rest posture before the first arming.
    pub(super) fn new(config: &Config) -> Self {
        Self { rests: config.joints.each_ref().map(|joint| joint.rest), is_confirmed: false }
    }

    /// Requires the posture again, before the network boots.
    pub(super) const fn restart(&mut self) {
        self.is_confirmed = false;
    }

    /// Checks joint positions `q`, in rad or m, at a request to arm. `names` are those of the joints, base first.
    ///
    /// # Errors
    /// At the first arming after a boot, every joint with a rest position that is not there.
    pub(super) fn check(&self, names: &[String; 6], q: &JointVector) -> Result<(), NotAtRest> {
        if self.is_confirmed {
            return Ok(());
        }
        let joints = Joint::each(self.rests.iter().zip(names).zip(q.iter()));
        let readings: Vec<_> = joints
            .filter_map(|(joint, ((rest, name), q))| {
                let rest = rest.filter(|rest| !rest.contains(*q))?;
                Some(Reading { joint, name: name.clone(), rest, q: *q })
            })
            .collect();
        if readings.is_empty() { Ok(()) } else { Err(NotAtRest(readings)) }
    }

    /// Requires the posture no more until the next boot: the arm was armed in it.
    pub(super) const fn on_armed(&mut self) {
        self.is_confirmed = true;
    }
}
