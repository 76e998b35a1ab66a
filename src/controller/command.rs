//! The command for the object: a rate (Eq. 5) or a pose (3.5) from the hand's displacement.
//!
//! Not what the object makes of it. A command begins without a jump (decision 29): in pose mode the
//! reference is set anew, in rate mode the rate stays zero until the hand has been back at the
//! centre or a reference has been set. Where the numbers of the orientation jump it ends the same
//! way (decision 4).

use nalgebra::Isometry3;

use crate::channels::Channels;
use crate::gains::Gains;
use crate::interpretation::{Displaced, Interpretation};
use crate::orientation::Orientation;
use crate::reference::{Displacement, Reference};
use crate::switches::{Mode, Pressed};
use units::spatial::{Motion, Twist};

/// Gains from a displacement to a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandLaw {
    /// K_V, in 1/s, applied after Eq. 5 in the axes of {MRF} (decision 6).
    pub rate_gain: Gains,
    /// K_P: by how much the object outreaches the hand.
    pub pose_gain: Gains,
    /// Deadband also applies in pose mode, where the paper did not find it useful.
    pub pose_deadband: bool,
}

/// Gate of the operator's command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// Deadman open: the command is to hold.
    Released,
    /// The deadman is held; the hand must come back to the centre, or set a reference, first.
    Waiting,
    /// As before, because the hand turned farther from its reference than its orientation can be
    /// commanded.
    TurnedTooFar,
    /// The command is the operator's.
    Open,
}

impl Gate {
    /// The gate of this cycle: `centred` says that the hand commands nothing from where it is,
    /// `set` that the reference was set here.
    #[must_use]
    pub fn next(
        self,
        pressed: &Pressed,
        mode: Mode,
        set: bool,
        centred: bool,
        is_within: bool,
    ) -> Self {
        let fresh = match mode {
            Mode::Rate => set || centred,
            // Elsewhere the object would jump to where the hand points.
            Mode::Pose => set || pressed.engaged && !pressed.latches,
        };
        match (pressed.commands, is_within, fresh) {
            (false, ..) => Self::Released,
            (true, false, _) => Self::TurnedTooFar,
            (true, true, true) => Self::Open,
            (true, true, false) if pressed.engaged || self == Self::Released => Self::Waiting,
            (true, true, false) => self,
        }
    }
}

impl CommandLaw {
    /// The part of a displacement that commands: ΔX less the deadband (decision 5).
    pub fn effective(&self, mode: Mode, channels: &Channels, dx: &Displacement) -> Displacement {
        match mode {
            Mode::Pose if !self.pose_deadband => *dx,
            Mode::Rate | Mode::Pose => channels.beyond_deadband(dx),
        }
    }

    /// The command for `dx_db`, what the deadband left of the displacement.
    pub fn motion(
        &self,
        interpretation: &Interpretation,
        mode: Mode,
        gate: Gate,
        reference: &Reference,
        dx_db: &Displacement,
    ) -> Motion {
        match (gate, mode) {
            (Gate::Released | Gate::Waiting | Gate::TurnedTooFar, _) => Motion::Hold,
            (Gate::Open, Mode::Rate) => Motion::Rate(self.rate(interpretation.orientation, dx_db)),
            (Gate::Open, Mode::Pose) => Motion::Pose(self.pose(interpretation, reference, dx_db)),
        }
    }

    /// The twist of {MRF}, in its own axes: K_V on the translation, and on Eq. 5.
    pub fn rate(&self, orientation: Orientation, dx_db: &Displacement) -> Twist {
        let angular = orientation.rate(&dx_db.orientation);
        Twist { linear: dx_db.translation, angular }.scaled(self.rate_gain.values())
    }

    /// Returns the same with each gain times the factor of its axis.
    #[must_use]
    pub fn scaled(&self, factors: &[f64; 6]) -> Self {
        let [rate_gain, pose_gain] =
            [self.rate_gain, self.pose_gain].map(|gain| gain.scaled(factors));
        Self { rate_gain, pose_gain, ..*self }
    }

    /// The pose of {MRF} in its base: the object's reference, moved as the hand moved from its own,
    /// times K_P (decision 7); along the axes of its base if ΔX is along those of the hand's.
    pub fn pose(
        &self,
        interpretation: &Interpretation,
        reference: &Reference,
        dx_db: &Displacement,
    ) -> Isometry3<f64> {
        let x_r_d = self.enlarged(interpretation, dx_db);
        let mut x_b_d = reference.x_b_r * x_r_d;
        if interpretation.displacement == Displaced::InBase {
            x_b_d.translation.vector =
                reference.x_b_r.translation.vector + x_r_d.translation.vector;
        }
        x_b_d
    }

    /// The object's reference from which `dx_db` commands `x_b_d`: the inverse of [`pose`](Self::pose).
    pub fn reference(
        &self,
        interpretation: &Interpretation,
        x_b_d: &Isometry3<f64>,
        dx_db: &Displacement,
    ) -> Isometry3<f64> {
        let x_r_d = self.enlarged(interpretation, dx_db);
        let mut x_b_r = x_b_d * x_r_d.inverse();
        if interpretation.displacement == Displaced::InBase {
            x_b_r.translation.vector = x_b_d.translation.vector - x_r_d.translation.vector;
        }
        x_b_r
    }

    /// The displacement times K_P.
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

    const HELD: Pressed = Pressed { commands: true, ..Pressed::NOTHING };
    const ENGAGED: Pressed = Pressed { engaged: true, ..HELD };

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
                let pressed = Pressed { commands, engaged: engaged && commands, ..Pressed::NOTHING };
                let mode = if rate { Mode::Rate } else { Mode::Pose };
                gate = gate.next(&pressed, mode, set, centred, is_within);
                prop_assert_eq!(gate == Gate::Released, !commands);
                prop_assert!(gate != Gate::Open || is_within);
            }
        }
    }

    #[test]
    fn displaced_hand_commands_no_rate_before_centre() {
        let next =
            |gate: Gate, pressed, centred| gate.next(pressed, Mode::Rate, false, centred, true);
        let gate = next(Gate::Released, &ENGAGED, false);
        assert_eq!(gate, Gate::Waiting);
        assert_eq!(next(gate, &HELD, false), Gate::Waiting);
        assert_eq!(next(gate, &HELD, true), Gate::Open);
        assert_eq!(next(Gate::Open, &HELD, false), Gate::Open);
    }

    #[test]
    fn a_displaced_hand_that_sets_a_reference_commands_at_once() {
        for mode in [Mode::Rate, Mode::Pose] {
            assert_eq!(Gate::Waiting.next(&HELD, mode, true, true, true), Gate::Open);
        }
    }

    #[test]
    fn passing_the_centre_does_not_open_the_gate_of_pose_mode() {
        assert_eq!(
            Gate::TurnedTooFar.next(&HELD, Mode::Pose, false, true, true),
            Gate::TurnedTooFar
        );
    }

    #[test]
    fn a_hand_turned_too_far_stays_unheard_until_it_begins_anew() {
        let gate = Gate::Open.next(&HELD, Mode::Rate, false, false, false);
        assert_eq!(gate, Gate::TurnedTooFar);
        let gate = gate.next(&HELD, Mode::Rate, false, false, true);
        assert_eq!(gate, Gate::TurnedTooFar);
        assert_eq!(gate.next(&HELD, Mode::Rate, false, true, true), Gate::Open);
    }

    #[test]
    fn the_deadband_is_off_in_pose_mode_unless_asked_for() {
        let channels = Channels::new([0.1; 6], [1.0; 6]).unwrap();
        let dx = Displacement::from_components([0.05, 0.3, 0.0, 0.05, 0.3, 0.0]);
        let law = law();
        assert_eq!(law.effective(Mode::Pose, &channels, &dx), dx);
        let asked = CommandLaw { pose_deadband: true, ..law };
        let left = channels.beyond_deadband(&dx);
        assert_eq!(asked.effective(Mode::Pose, &channels, &dx), left);
        assert_eq!(law.effective(Mode::Rate, &channels, &dx), left);
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
