//! Steps that lead on from a mode, in sentences for reports on sessions and viewers of a running node (docs/operation.md).

use node::cause::{Cause, CauseKind};
use node::reaction::Initiator;
use node::record::Mode;
use node::zero::ZeroState;
use units::numbering::Joint;

/// Step that closes the deadman after arming (ADR 12).
const PRESS_DEADMAN: &str =
    "release the deadman and press it again: both contacts open for 25 ms, then closed for 25 ms.";

/// Mode, causes and zeros, which decide the steps that lead on.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    pub mode: Mode,
    pub cause: Option<Cause>,
    /// Drives that have not confirmed power off.
    pub not_off: &'a [bool; 6],
    pub zeros: &'a [ZeroState; 6],
    pub has_switch_box: bool,
}

impl Situation<'_> {
    /// Returns the steps that lead on. `names` are those of the joints, base first.
    pub fn steps(&self, names: &[&str]) -> Vec<String> {
        let name = |joint: Joint| names.get(joint.index()).copied();
        if self.mode.is_latched() {
            let joint = self.cause.and_then(|cause| name(cause.joint()?));
            return of_stop(self.cause.map(|cause| cause.kind()), joint, &self.not_off(names));
        }
        let unknown = Joint::each(self.zeros).filter_map(|(joint, zero)| match zero {
            ZeroState::Unknown(why) => Some(format!("{}: {why}", name(joint)?)),
            ZeroState::Known => None,
        });
        onwards(self.mode, self.has_switch_box, &unknown.collect::<Vec<_>>())
    }

    /// Returns the names of the joints whose drives have not confirmed power off.
    pub fn not_off<'n>(&self, names: &[&'n str]) -> Vec<&'n str> {
        let not_off = Joint::each(self.not_off).filter(|(_, is_set)| **is_set);
        not_off.filter_map(|(joint, _)| names.get(joint.index()).copied()).collect()
    }
}

/// Returns the steps that lead out of a stop. `joint` is the name of the cause's joint, if any. `not_off` are the names of
/// joints whose drives have not confirmed power off.
pub fn of_stop(
    kind: Option<CauseKind>,
    joint: Option<&str>,
    not_off: &[impl AsRef<str>],
) -> Vec<String> {
    let mut steps = Vec::new();
    if !not_off.is_empty() {
        let names: Vec<_> = not_off.iter().map(AsRef::as_ref).collect();
        steps.push(format!(
            "The drives of {} did not report that they are off. Such a drive may push: press the emergency stop, which cuts its power by wire.",
            names.join(", ")
        ));
    }
    let place = joint.map(|joint| format!(" at {joint}")).unwrap_or_default();
    steps.push(match kind.map(|kind| (kind, kind.row().initiator)) {
        Some((kind, Initiator::Drive)) => format!(
            "Remove the cause{place}: {}. The drive itself has stopped; its fault must be gone in the drive.",
            kind.description()
        ),
        Some((kind, _)) => format!("Remove the cause{place}: {}.", kind.description()),
        None => format!("Remove the cause{place}."),
    });
    steps.push("`frhc ctl status` shows the cause while it is present.".to_owned());
    steps.push(match kind.map(|kind| (kind.row().reset_boots, kind.row().is_reset_in_drive())) {
        Some((true, _)) => "`frhc ctl reset` ends the stop. It boots the network again, since a node may have lost its configuration, and fails while the cause is present.".to_owned(),
        Some((_, true)) => "`frhc ctl reset` ends the stop, and resets the fault of the drive once.".to_owned(),
        Some((false, false)) | None => "`frhc ctl reset` ends the stop; it is refused while the cause is present.".to_owned(),
    });
    let arm = "`frhc ctl arm` with the deadman released, if the node is ready, not armed";
    steps.push(format!("{arm}; then {PRESS_DEADMAN}"));
    steps
}

/// Returns the steps that lead on from a mode without a stop; empty while engaged. Arming requires a switch box, and every zero:
/// `unknown` are the names of joints without one, each with the reason.
pub fn onwards(mode: Mode, has_switch_box: bool, unknown: &[String]) -> Vec<String> {
    let step = match mode {
        Mode::Boot => {
            "Wait: drives are configured, enabled and proof-tested at zero torque.".to_owned()
        }
        Mode::Ready if !has_switch_box => {
            "The configuration has no switch box, so nothing can be armed.".to_owned()
        }
        Mode::Ready if !unknown.is_empty() => format!(
            "Zero unknown, so nothing can be armed: {}. Lay the arm in its rest posture, then `frhc ctl zero`.",
            unknown.join("; ")
        ),
        Mode::Ready => {
            "Hold the grip, then `frhc ctl arm`: the arm carries its own weight within a second."
                .to_owned()
        }
        Mode::Armed => format!("To command and feel, {PRESS_DEADMAN}"),
        Mode::Measuring => "Hold the deadman: the arm moves by itself, or the one drive that is tried pushes. Released, it stays where it is. `frhc ctl disarm` ends it."
            .to_owned(),
        Mode::Engaged | Mode::ReflectionOff | Mode::ZeroTorque | Mode::DrivesOff => {
            return Vec::new();
        }
    };
    vec![step]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_out_of_a_stop_name_drives_that_may_push() {
        let steps = of_stop(Some(CauseKind::SamplesMissing), Some("elbow"), &["elbow"]);
        assert!(steps[0].contains("drives of elbow did not report"), "{steps:?}");
        let reset =
            |step: &String| step.contains("frhc ctl reset") && step.contains("boots the network");
        assert!(steps.iter().any(reset), "{steps:?}");
        for kind in CauseKind::ALL {
            let steps = of_stop(Some(kind), None, &[""; 0]);
            assert!(steps[0].contains(kind.description()), "{kind:?}");
        }
    }

    #[test]
    fn every_mode_but_engaged_and_the_stops_has_a_step() {
        for mode in Mode::ALL {
            let has_none = mode == Mode::Engaged || mode.is_latched();
            assert_eq!(onwards(mode, true, &[]).is_empty(), has_none, "{mode}");
        }
        assert!(onwards(Mode::Ready, false, &[])[0].contains("no switch box"));
        let unknown = ["elbow: the drive has rebooted".to_owned()];
        let step = &onwards(Mode::Ready, true, &unknown)[0];
        assert!(step.contains("elbow: the drive has rebooted. Lay the arm"), "{step}");
    }
}
