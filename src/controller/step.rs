//! One cycle of the control law, from joint positions and wrench to torques and command, in the order of Fig. 3.

mod adjusting;
mod joint_torques;

use nalgebra::Isometry3;

use crate::adjustment::AdjustmentState;
use crate::alignment::Alignment;
use crate::arm::Posture;
use crate::assist::{self, Damping};
use crate::breakaway::Breakaway;
use crate::command::Gate;
use crate::contact_stiffness::ContactStiffness;
use crate::hold::weight::{self, TooHeavy};
use crate::hold::{Hold, HoldGoal};
use crate::interpretation::{Centring, ReflectionFrame};
use crate::limits::Limits;
use crate::port::{Port, PortOutput, Storage};
use crate::reference::{Displacement, Reference};
use crate::scaling::Scaling;
use crate::switches::{CommandMode, Permissions, SwitchLogic};
use crate::valid_input::ValidInput;
use crate::velocity::{GripTwist, JointRates, Velocity};
use crate::{Extensions, Input, InvalidValue, JointVector, Output, Settings};
use units::drive::{Counts, PerMille};
use units::numbering::Joint;
use units::spatial::{Jacobian, Motion, Wrench};

/// Control law (Fig. 3) with its state.
#[derive(Clone, Copy, Debug)]
pub struct Controller {
    settings: Settings,
    /// Extensions beside the paper's law, with their state.
    layers: Extensions,
    limits: Limits<6>,
    switch_logic: SwitchLogic,
    reference: Reference,
    gate: Gate,
    rates: JointRates<6>,
    velocity: Velocity,
    damping: Damping,
    port: Port,
    contact: ContactStiffness,
    scaling: Scaling,
    hold: Hold,
    /// Alignment in progress.
    alignment: Option<Alignment>,
    /// Sensed wrench of the last cycle, at {MRF}.
    f_m_sensed: Wrench,
    /// Actuator torques of the last cycle, and their targets.
    last: (JointVector, [PerMille; 6]),
    mode: CommandMode,
    /// Last pose of the object.
    x_b_m: Isometry3<f64>,
    /// Last command, if it was a pose.
    x_b_commanded: Option<Isometry3<f64>>,
}

/// State of the arm in this cycle.
struct ArmState {
    q: JointVector,
    qd: JointVector,
    posture: Posture<6>,
    j_g: Jacobian<6>,
    twist: GripTwist,
}

/// Wrenches on the hand at {G}, for Jᵀ.
struct GripWrenches {
    port: PortOutput,
    f_g_centring: Wrench,
    f_g_damping: Wrench,
    /// Share of the engagement ramp, 0 to 1.
    ramp: f64,
}

/// Input of the reflection port.
struct Touch {
    /// Task wrench at {G}, with K_T and the engagement ramp.
    f_g_felt: Wrench,
    /// Task wrench at {MRF}.
    f_m_task: Wrench,
    /// Pose of the grip in its reference.
    x_h_g: Isometry3<f64>,
    /// Pose of the object in its base.
    x_b_m: Isometry3<f64>,
}

impl Controller {
    /// Creates a controller without a reference, with reflection off.
    pub fn new(settings: &Settings) -> Self {
        let Settings {
            interpretation,
            period,
            arm,
            calibration,
            assist_fraction,
            dry_friction,
            extensions,
            ..
        } = *settings;
        Self {
            settings: *settings,
            layers: extensions,
            limits: Limits::new(calibration.max_torques(), assist_fraction, interpretation.scaling),
            switch_logic: SwitchLogic::new(CommandMode::Rate, interpretation.latches),
            reference: Reference::none(),
            gate: Gate::Released,
            rates: JointRates::new(period),
            velocity: Velocity::new(period, extensions.velocity_filter),
            damping: Damping::new(settings.damping, period, interpretation.damping),
            port: Port::new(period, &extensions),
            contact: ContactStiffness::default(),
            scaling: Scaling::new(period),
            hold: Hold::new(period, arm.kinds(), dry_friction),
            alignment: None,
            f_m_sensed: Wrench::ZERO,
            last: (JointVector::zeros(), [PerMille(0); 6]),
            mode: CommandMode::Rate,
            x_b_m: Isometry3::identity(),
            x_b_commanded: None,
        }
    }

    /// Converts actual positions (6064h) to joint positions, in rad or m.
    pub fn positions(&self, counts: &[Counts; 6]) -> JointVector {
        self.settings.calibration.positions(counts)
    }

    /// Sets the goal to which the hold moves the arm, or none.
    pub fn set_hold(&mut self, goal: Option<HoldGoal>) {
        self.hold.set_goal(goal);
    }

    /// Lets an arm go that a hold has moved: its damping ends.
    pub const fn let_go(&mut self) {
        self.hold.let_go();
    }

    /// Checks that the actuators can carry the arm on the straight way from `from` to `to`, in rad or m.
    ///
    /// # Errors
    /// Returns the actuator with the greatest load beyond its capacity.
    pub fn check_way(&self, from: &JointVector, to: &JointVector) -> Result<(), TooHeavy> {
        weight::check(&self.settings.arm, &self.settings.calibration, [from, to])
    }

    /// Returns the breakaway of the actuator of a joint as described, with the arm at `q`, in rad or m.
    pub fn breakaway(&self, joint: Joint, q: &JointVector) -> Breakaway {
        let Settings { arm, calibration, dry_friction, .. } = &self.settings;
        Breakaway::new(arm, calibration, dry_friction, q, joint)
    }

    /// Computes one cycle (Fig. 3).
    pub fn step(&mut self, input: &Input) -> Output {
        let q = self.positions(&input.counts);
        self.step_at(&q, input)
    }

    /// Computes one cycle at joint positions `q` in rad or m, which must be finite, in place of the input's counts.
    pub fn step_at(&mut self, q: &JointVector, input: &Input) -> Output {
        let Settings { interpretation, calibration, channels, command: law, reflection, .. } =
            self.settings;
        let given = ValidInput::from_input(input, &self.x_b_m);
        let permissions = self.switch_logic.read(input.switches, input.mode); // 4.1

        let arm = self.arm_state(q, input.restart);
        let x_0_g = arm.posture.x_0_g; // Eq. 1

        let x_b_last = self.x_b_commanded.unwrap_or(given.x_b_m);
        let is_new = self.reference.update(&permissions, &x_0_g, &x_b_last);
        let x_h_g = self.reference.displacement(&x_0_g); // Eq. 2, 3
        let dx = self.reference.dx(&interpretation, &x_h_g); // Eq. 4

        let dx_db = law.effective(input.mode, &channels, &dx);
        let is_within = interpretation.orientation.is_within(&dx.orientation);
        let gate = self.gate.next(&permissions, input.mode, is_new, dx_db.is_zero(), is_within);
        self.f_m_sensed = reflection.at_object(&given.f_s); // Eq. 6
        let law = self.scaled(&law, input.mode, &dx_db);
        self.align(&law, (gate == Gate::Open && !is_new).then_some(input.mode), &x_0_g, &dx_db);
        let command = law.motion(&interpretation, input.mode, gate, &self.reference, &dx_db); // Eq. 5, 3.5

        let f_m_task = self.task(&given, &command);
        let f_g_felt = self.reflected(&f_m_task, &x_h_g); // K_T
        let ramp = self.ramp(&permissions, &f_g_felt);
        let contact = Touch { f_g_felt: f_g_felt * ramp, f_m_task, x_h_g, x_b_m: given.x_b_m };
        let port = self.pass(input, &arm, &contact);

        let f_g_centring = self.centring(&permissions, input.mode, &x_0_g, &dx) * ramp; // Eq. 8
        let is_first = input.restart || is_new || input.mode != self.mode;
        let drag = self.damping.wrench(&arm.twist.v_g, &x_h_g, &dx, is_first); // Eq. 9
        let f_g_damping = permitted(permissions.damping, self.port.bounded_damping(&drag, &port));

        let grip = GripWrenches { port, f_g_centring, f_g_damping, ramp };
        let request = self.torques(&given, &permissions, &arm, &grip); // Eq. 7, 3.3
        let request = self.held(request, input, &arm);
        let (tau, ledger, broken) = self.limit(request, input.held); // Eq. 10
        let targets = calibration.targets(&tau); // Fig. 6

        (self.gate, self.mode, self.last.1) = (gate, input.mode, targets);
        (self.x_b_m, self.x_b_commanded) = (given.x_b_m, commanded_pose(&command));
        Output {
            q: arm.q,
            joint_out_of_range: self.settings.arm.out_of_range(q).and_then(Joint::at),
            x_0_g,
            permissions,
            reference: self.reference,
            x_h_g,
            dx,
            dx_db,
            gate,
            command,
            adjusted: AdjustmentState::new(&self.scaling, self.alignment.is_some()),
            twist: arm.twist,
            f_m_task,
            f_g_task: port.f_g_task,
            port,
            f_g_centring,
            f_g_damping,
            j_g: arm.j_g,
            hold: self.hold.output(q),
            ledger,
            tau,
            targets,
            invalid_value: broken.or(given.invalid_value).or(turned_too_far(gate)),
        }
    }

    /// Computes forward kinematics, Jacobian and velocities at joint positions `q`.
    fn arm_state(&mut self, q: &JointVector, restart: bool) -> ArmState {
        let arm = &self.settings.arm;
        let posture = arm.posture(q);
        ArmState {
            q: *q,
            qd: self.rates.update(q, restart),
            j_g: arm.jacobian(&posture),
            twist: self.velocity.update(&posture.x_0_g, restart),
            posture,
        }
    }

    /// Returns the task wrench at {MRF}: the sensed one or, in pose mode with a virtual coupling, the wrench of the
    /// coupling.
    fn task(&mut self, given: &ValidInput, command: &Motion) -> Wrench {
        let f_m_sensed = self.f_m_sensed;
        let Some(coupling) = &mut self.layers.virtual_coupling else { return f_m_sensed };
        match command {
            Motion::Pose(x_b_d) => coupling.wrench(Some(x_b_d), &given.x_b_m),
            Motion::Rate(_) | Motion::Hold => {
                coupling.wrench(None, &given.x_b_m);
                f_m_sensed
            }
        }
    }

    /// Reflects a wrench from {MRF} to {G}, along the axes of the chosen interpretation (decision 30).
    fn reflected(&self, f_m_task: &Wrench, x_h_g: &Isometry3<f64>) -> Wrench {
        let f = self.settings.reflection.at_grip(&(*f_m_task * self.scaling.factors().force));
        match self.settings.interpretation.task {
            ReflectionFrame::Grip => f,
            ReflectionFrame::Reference => f.turned(&x_h_g.rotation.inverse()),
        }
    }

    /// Returns the share of the engagement ramp, 0 to 1.
    fn ramp(&mut self, permissions: &Permissions, f_g_felt: &Wrench) -> f64 {
        match &mut self.layers.engagement {
            Some(engagement) => engagement.share(permissions.task, f_g_felt),
            None if permissions.task => 1.0,
            None => 0.0,
        }
    }

    /// Books the held torques, then passes the task wrench through the reflection port.
    fn pass(&mut self, input: &Input, arm: &ArmState, touch: &Touch) -> PortOutput {
        let mut storage = Storage::default();
        if self.port.is_observed() {
            let (tau_a, targets) = &self.last;
            let calibration = &self.settings.calibration;
            let held =
                input.held.map(|held| calibration.held_torques(&held.targets(), targets, tau_a));
            self.port.book(&held.unwrap_or(*tau_a), calibration.coupling());
            storage = self.storage(input.mode, touch);
        }
        self.port.pass(&arm.q, &arm.twist, &touch.f_g_felt, storage)
    }

    /// Computes the energy that the contact stores and returns in this mode.
    fn storage(&mut self, mode: CommandMode, touch: &Touch) -> Storage {
        let Touch { f_g_felt, f_m_task, x_h_g, x_b_m } = touch;
        let f_b = x_b_m.rotation * f_m_task.force;
        self.contact.update(&f_b, &x_b_m.translation.vector);
        match mode {
            CommandMode::Pose => {
                let pose_gain = self.settings.command.pose_gain;
                let pose_gain = pose_gain.scaled(&self.scaling.factors().command);
                let stored = self.contact.stored(f_g_felt, f_m_task, &pose_gain);
                Storage { stored, returned: 0.0, raised: stored * self.scaling.force_rise() }
            }
            CommandMode::Rate => {
                // Work on a hand that returns to its reference at constant force.
                let push = x_h_g.rotation * f_g_felt.force;
                let returned = -push.dot(&x_h_g.translation.vector);
                Storage { stored: 0.0, returned, raised: 0.0 }
            }
        }
    }

    /// Computes the return to centre in rate mode, and walls only in pose mode (3.5).
    fn centring(
        &self,
        permissions: &Permissions,
        mode: CommandMode,
        x_0_g: &Isometry3<f64>,
        dx: &Displacement,
    ) -> Wrench {
        let Settings { interpretation, channels, .. } = &self.settings;
        let channels = match mode {
            CommandMode::Rate if permissions.centring => *channels,
            CommandMode::Pose if self.layers.walls_in_pose => channels.walls_only(),
            CommandMode::Rate | CommandMode::Pose => return Wrench::ZERO,
        };
        match interpretation.centring {
            Centring::Components => assist::centring_by_components(&channels, dx),
            Centring::Conjugate => {
                let r_g_dx = self.reference.turn_to_grip(interpretation.displacement, x_0_g);
                assist::centring(&channels, interpretation.orientation, &r_g_dx, dx)
            }
        }
    }
}

/// Returns the reason of a gate that closed since the hand turned too far.
fn turned_too_far(gate: Gate) -> Option<InvalidValue> {
    (gate == Gate::TurnedTooFar).then_some(InvalidValue::TurnedTooFar)
}

/// Returns the wrench if it is permitted, else zero.
fn permitted(is_permitted: bool, f_g: Wrench) -> Wrench {
    if is_permitted { f_g } else { Wrench::ZERO }
}

/// Returns `x_b_d` of a pose command; `None` for a hold or a rate.
fn commanded_pose(command: &Motion) -> Option<Isometry3<f64>> {
    match command {
        Motion::Pose(x_b_d) => Some(*x_b_d),
        Motion::Hold | Motion::Rate(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjustment::Bounds;
    use crate::arm::{Arm, Link};
    use crate::calibration::{Calibration, JointCalibration, TorqueCurve};
    use crate::channels::Channels;
    use crate::command::CommandLaw;
    use crate::gains::Gains;
    use crate::interpretation::Interpretation;
    use crate::limits::AssistFraction;
    use crate::period::Period;
    use crate::reflection::Reflection;
    use crate::switches::Switches;
    use units::spatial::Twist;

    /// Returns a controller whose last joint lifts 2 kg at a lever of 0.3 m, with a capacity of 10 N·m in every joint.
    fn lifting(interpretation: Interpretation) -> Controller {
        let mut links = [Link { rotor_inertia: 1e-3, ..Link::TURNING }; 6];
        links[5] = Link { mass: 2.0, centre_of_mass: [0.3, 0.0, 0.0], ..links[5] };
        let curve = TorqueCurve::new([50.0, 0.0, 0.0], 10.0).unwrap();
        let joint = JointCalibration::new(4_096, 100.0, 0, curve).unwrap();
        let none = Gains::new([0.0; 6], "none").unwrap();
        let command = CommandLaw { rate_gain: none, pose_gain: none, pose_deadband: false };
        Controller::new(&Settings {
            interpretation,
            period: Period::new(1e-3).unwrap(),
            arm: Arm::new(links, Isometry3::identity(), [0.0, -9.81, 0.0]).unwrap(),
            calibration: Calibration::new([joint; 6]),
            channels: Channels::new([0.0; 6], [0.0; 6]).unwrap(),
            command,
            reflection: Reflection::new(Isometry3::identity(), none, 10.0, 1.0).unwrap(),
            damping: none,
            // The paper scales gravity with the assist.
            assist_fraction: AssistFraction::new(1.0).unwrap(),
            bounds: Bounds::FIXED,
            dry_friction: JointVector::zeros(),
            extensions: Extensions::default(),
        })
    }

    /// Returns an input with every switch open, and different shares of reflection and gravity.
    fn carried(gravity_share: f64) -> Input {
        Input {
            counts: [Counts(0); 6],
            f_s: Wrench::ZERO,
            x_b_m: Isometry3::identity(),
            switches: Switches::default(),
            mode: CommandMode::Rate,
            gravity_share,
            reflection_share: 0.3,
            hold: false,
            held: None,
            restart: true,
        }
    }

    #[test]
    fn step_carries_the_share_of_the_weight_that_is_asked_for() {
        for interpretation in [Interpretation::CONSISTENT, Interpretation::PAPER_1997] {
            for share in [0.0, 0.25, 0.8, 1.0] {
                let output = lifting(interpretation).step(&carried(share));
                // All joints turn about one axis, level with the weight.
                let weight = JointVector::repeat(2.0 * 9.81 * 0.3 * share);
                assert!((output.tau - weight).amax() < 1e-9, "{share}: {}", output.tau);
                assert!((output.ledger.gravity - weight).amax() < 1e-9, "{share}");
                assert_eq!(output.invalid_value, None);
                // 50 ‰ per N·m.
                let PerMille(target) = output.targets[5];
                assert!((f64::from(target) - 50.0 * weight[5]).abs() <= 0.5, "{share}: {target}");
            }
        }
    }

    #[test]
    fn step_with_an_invalid_gravity_share_carries_nothing() {
        for wrong in [-0.1, 1.1, f64::NAN] {
            let output = lifting(Interpretation::CONSISTENT).step(&carried(wrong));
            assert_eq!(
                (output.tau, output.invalid_value),
                (JointVector::zeros(), Some(InvalidValue::ShareOutOfRange))
            );
        }
    }

    #[test]
    fn wrench_acts_only_where_it_is_permitted() {
        let f_g = Wrench::from_components([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]);
        assert_eq!((permitted(true, f_g), permitted(false, f_g)), (f_g, Wrench::ZERO));
    }

    #[test]
    fn only_a_pose_is_asked_for_as_a_pose() {
        let x_b_d = Isometry3::translation(0.1, 0.2, 0.3);
        assert_eq!(commanded_pose(&Motion::Pose(x_b_d)), Some(x_b_d));
        assert_eq!(commanded_pose(&Motion::Hold), None);
        assert_eq!(commanded_pose(&Motion::Rate(Twist::ZERO)), None);
    }
}
