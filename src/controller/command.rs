//! Command for the object: a rate (Eq. 5) or a pose (3.5) from the hand's displacement.
//!
//! A command starts without a jump (decision 29). In pose mode it sets a new reference. In rate mode the rate is zero
//! until the hand has returned to the centre or set a reference. Near the singularity of the orientation parameters the
//! command ends, and restarts in the same way (decision 4).

use nalgebra::Isometry3;

use crate::channels::Channels;
use crate::gains::Gains;
use crate::interpretation::{DisplacementFrame, Interpretation};
use crate::orientation::Orientation;
use crate::reference::{Displacement, Reference};
use crate::switches::{CommandMode, Permissions};
use units::spatial::{Motion, Twist};

/// Gains from displacement to command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandLaw {
    /// K_V, in 1/s, applied after Eq. 5 in the axes of {MRF} (decision 6).
    pub rate_gain: Gains,
    /// K_P: displacement of the object per displacement of the hand.
    pub pose_gain: Gains,
    /// Deadband also applies in pose mode, unlike in the paper.
    pub pose_deadband: bool,
}

/// Gate of the operator's command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// Deadman open: the object holds.
    Released,
    /// Deadman held; the object holds until the hand returns to the centre or sets a reference.
    Waiting,
    /// Deadman held; the object holds, since the hand's rotation from its reference exceeds the commandable range.
    TurnedTooFar,
    /// Deadman held: the displacement commands the object.
    Open,
}

impl Gate {
    /// Returns the gate of this cycle. `centred`: the displacement is within the deadband. `set`: the reference was set in
    /// this cycle. `is_within`: the orientation is in the commandable range.
    #[must_use]
    pub fn next(
        self,
        permissions: &Permissions,
        mode: CommandMode,
        set: bool,
        centred: bool,
        is_within: bool,
    ) -> Self {
        let fresh = match mode {
            CommandMode::Rate => set || centred,
            // Otherwise the object would jump to the displacement of the hand.
            CommandMode::Pose => set || permissions.engaged && !permissions.latches,
        };
        match (permissions.commands, is_within, fresh) {
            (false, ..) => Self::Released,
            (true, false, _) => Self::TurnedTooFar,
            (true, true, true) => Self::Open,
            (true, true, false) if permissions.engaged || self == Self::Released => Self::Waiting,
            (true, true, false) => self,
        }
    }
}

impl CommandLaw {
    /// Returns the commanding part of a displacement: ΔX less the deadband (decision 5).
    pub fn effective(
        &self,
        mode: CommandMode,
        channels: &Channels,
        dx: &Displacement,
    ) -> Displacement {
        let is_whole = mode == CommandMode::Pose && !self.pose_deadband;
        if is_whole { *dx } else { channels.beyond_deadband(dx) }
    }

    /// Returns the command for `dx_db`, the displacement less the deadband.
    pub fn motion(
        &self,
        interpretation: &Interpretation,
        mode: CommandMode,
        gate: Gate,
        reference: &Reference,
        dx_db: &Displacement,
    ) -> Motion {
        use CommandMode::{Pose, Rate};
        match (gate, mode) {
            (Gate::Released | Gate::Waiting | Gate::TurnedTooFar, _) => Motion::Hold,
            (Gate::Open, Rate) => Motion::Rate(self.rate(interpretation.orientation, dx_db)),
            (Gate::Open, Pose) => Motion::Pose(self.pose(interpretation, reference, dx_db)),
        }
    }

    /// Computes the commanded twist of {MRF}, written in {MRF}: K_V times translation and Eq. 5.
    pub fn rate(&self, orientation: Orientation, dx_db: &Displacement) -> Twist {
        let angular = orientation.rate(&dx_db.orientation);
        Twist { linear: dx_db.translation, angular }.scaled(self.rate_gain.values())
    }

    /// Multiplies each gain by the factor of its axis.
    #[must_use]
    pub fn scaled(&self, factors: &[f64; 6]) -> Self {
        let [rate_gain, pose_gain] =
            [self.rate_gain, self.pose_gain].map(|gain| gain.scaled(factors));
        Self { rate_gain, pose_gain, ..*self }
    }

    /// Computes the commanded pose of {MRF} in its base: the object's reference, displaced by K_P times the displacement of
    /// the hand (decision 7). The translation is along the axes of the object's base if ΔX is written in {0}.
    pub fn pose(
        &self,
        interpretation: &Interpretation,
        reference: &Reference,
        dx_db: &Displacement,
    ) -> Isometry3<f64> {
        let x_r_d = self.enlarged(interpretation, dx_db);
        let mut x_b_d = reference.x_b_r * x_r_d;
        if interpretation.displacement == DisplacementFrame::Base {
            x_b_d.translation.vector =
                reference.x_b_r.translation.vector + x_r_d.translation.vector;
        }
        x_b_d
    }

    /// Computes the object's reference at which `dx_db` commands `x_b_d`: the inverse of [`pose`](Self::pose).
    pub fn reference(
        &self,
        interpretation: &Interpretation,
        x_b_d: &Isometry3<f64>,
        dx_db: &Displacement,
    ) -> Isometry3<f64> {
        let x_r_d = self.enlarged(interpretation, dx_db);
        let mut x_b_r = x_b_d * x_r_d.inverse();
        if interpretation.displacement == DisplacementFrame::Base {
            x_b_r.translation.vector = x_b_d.translation.vector - x_r_d.translation.vector;
        }
        x_b_r
    }

    /// Computes the displacement times K_P, as a pose.
    fn enlarged(&self, interpretation: &Interpretation, dx_db: &Displacement) -> Isometry3<f64> {
        let enlarged = dx_db.scaled(self.pose_gain.values());
        Isometry3::from_parts(
            enlarged.translation.into(),
            interpretation.orientation.rotation(&enlarged.orientation),
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn law() -> CommandLaw {
        CommandLaw {
            rate_gain: Gains::new([2.0, 2.0, 2.0, 1.5, 1.5, 1.5], "K_V").unwrap(),
            pose_gain: Gains::new([1.0; 6], "K_P").unwrap(),
            pose_deadband: false,
        }
    }

    const HELD: Permissions = Permissions { commands: true, ..Permissions::NOTHING };
    const ENGAGED: Permissions = Permissions { engaged: true, ..HELD };

    proptest! {
        #[test]
        fn at_a_pose_gain_of_one_the_object_moves_as_the_hand(
            [x, y, z, a, b, c] in prop::array::uniform6(-1.0..1.0_f64)
        ) {
            let x_h_g = Isometry3::new([x, y, z].into(), [a, b, c].into());
            let mut reference = Reference::none();
            reference.x_b_r = Isometry3::new([z, x, y].into(), [c, a, b].into());
            for orientation in [Orientation::EulerZyx, Orientation::RotationVector] {
                let dx = Displacement::between(&x_h_g, orientation);
                let interpretation = Interpretation { orientation, ..Interpretation::CONSISTENT };
                let x_b_d = law().pose(&interpretation, &reference, &dx);
                let difference = x_b_d.to_homogeneous() - (reference.x_b_r * x_h_g).to_homogeneous();
                prop_assert!(difference.norm() < 1e-12);
            }
        }

        #[test]
        fn reference_of_a_pose_commands_it(
            dx in prop::array::uniform6(-1.0..1.0_f64), at in prop::array::uniform6(-1.0..1.0_f64),
            gain in 0.0..2.0_f64,
        ) {
            let ([x, y, z, a, b, c], dx) = (at, Displacement::from_components(dx));
            let x_b_d = Isometry3::new([x, y, z].into(), [a, b, c].into());
            let law = law().scaled(&[gain; 6]);
            for interpretation in [Interpretation::CONSISTENT, Interpretation::PAPER_1997] {
                let mut reference = Reference::none();
                reference.x_b_r = law.reference(&interpretation, &x_b_d, &dx);
                let difference = law.pose(&interpretation, &reference, &dx).inverse() * x_b_d;
                prop_assert!(difference.translation.vector.norm() < 1e-12);
                prop_assert!(difference.rotation.angle() < 1e-7);
            }
        }

        #[test]
        fn a_command_is_only_passed_on_while_the_deadman_is_held(
            steps in prop::collection::vec(any::<[bool; 6]>(), 0..30)
        ) {
            let mut gate = Gate::Released;
            for [commands, engaged, set, centred, is_within, rate] in steps {
                let permissions = Permissions { commands, engaged: engaged && commands, ..Permissions::NOTHING };
                let mode = if rate { CommandMode::Rate } else { CommandMode::Pose };
                gate = gate.next(&permissions, mode, set, centred, is_within);
                prop_assert_eq!(gate == Gate::Released, !commands);
                prop_assert!(gate != Gate::Open || is_within);
            }
        }
    }

    #[test]
    fn displaced_hand_commands_no_rate_before_centre() {
        let next = |gate: Gate, permissions, centred| {
            gate.next(permissions, CommandMode::Rate, false, centred, true)
        };
        let gate = next(Gate::Released, &ENGAGED, false);
        assert_eq!(gate, Gate::Waiting);
        assert_eq!(next(gate, &HELD, false), Gate::Waiting);
        assert_eq!(next(gate, &HELD, true), Gate::Open);
        assert_eq!(next(Gate::Open, &HELD, false), Gate::Open);
    }

    #[test]
    fn a_displaced_hand_that_sets_a_reference_commands_at_once() {
        for mode in [CommandMode::Rate, CommandMode::Pose] {
            assert_eq!(Gate::Waiting.next(&HELD, mode, true, true, true), Gate::Open);
        }
    }

    #[test]
    fn passing_the_centre_does_not_open_the_gate_of_pose_mode() {
        assert_eq!(
            Gate::TurnedTooFar.next(&HELD, CommandMode::Pose, false, true, true),
            Gate::TurnedTooFar
        );
    }

    #[test]
    fn a_hand_turned_too_far_stays_unheard_until_it_begins_anew() {
        let gate = Gate::Open.next(&HELD, CommandMode::Rate, false, false, false);
        assert_eq!(gate, Gate::TurnedTooFar);
        let gate = gate.next(&HELD, CommandMode::Rate, false, false, true);
        assert_eq!(gate, Gate::TurnedTooFar);
        assert_eq!(gate.next(&HELD, CommandMode::Rate, false, true, true), Gate::Open);
    }

    #[test]
    fn the_deadband_is_off_in_pose_mode_unless_asked_for() {
        let channels = Channels::new([0.1; 6], [1.0; 6]).unwrap();
        let dx = Displacement::from_components([0.05, 0.3, 0.0, 0.05, 0.3, 0.0]);
        let law = law();
        assert_eq!(law.effective(CommandMode::Pose, &channels, &dx), dx);
        let asked = CommandLaw { pose_deadband: true, ..law };
        let left = channels.beyond_deadband(&dx);
        assert_eq!(asked.effective(CommandMode::Pose, &channels, &dx), left);
        assert_eq!(law.effective(CommandMode::Rate, &channels, &dx), left);
    }

    #[test]
    fn resting_hand_commands_no_motion() {
        let law = law();
        assert_eq!(law.rate(Orientation::EulerZyx, &Displacement::default()), Twist::ZERO);
        let mut reference = Reference::none();
        reference.x_b_r = Isometry3::translation(1.0, 2.0, 3.0);
        assert_eq!(
            law.pose(&Interpretation::CONSISTENT, &reference, &Displacement::default()),
            reference.x_b_r
        );
    }
}
