//! Position hold: joint torques that keep a posture and follow a slow path. Not in the paper; a law of its own beside Fig. 3.
//!
//! ```text
//!  τ = g(q) + h        h = M(q) (ω² e + 2 ω ė) + i, within ± b(q)        e = q_d - q
//!  di/dt = M(q) k ω³ e            unless h is at its bound, or e is within 0.25°
//!  b(q)  = 3 N · lever(q) + 0.4 |g(q)| + 2 f_c
//! ```
//!
//! `g` is gravity compensation, which its owner ramps. `M`, with 0.2 kg at the grip, decouples the joints, so that one frequency
//! ω holds for all of them; it is low enough for the delay of the bus. In the first second nothing moves: the hold takes over
//! the weight that the description lacks.
//!
//! The bound `b` is what the hold may push with: a hand at the grip overcomes it, a wrong mass and dry friction (`f_c`) do not.
//! Where it is reached the path waits; where it stays so, or the position stays the same (`standstill`) although the joint is
//! pushed on, the joint is blocked. A joint that is blocked within the tolerance of its goal has arrived: it lies in its cradle.
//!
//! When the hold ends, its integral, which is weight that the arm's description lacks, leaves in three seconds. Until its owner lets
//! the arm go a spring trails each joint, no faster than 0.02 rad/s: the arm sinks, it does not fall. The spring slips where its
//! torque is at the bound, so a hand that moves the arm is not pulled back.

mod path;
mod standstill;
pub mod weight;

use nalgebra::SMatrix;

use crate::JointVector;
use crate::arm::JointKind;
use crate::hold::path::Path;
use crate::hold::standstill::{Pushed, Standstill};
use crate::period::Period;
use units::numbering::Joint;
use units::spatial::Jacobian;

/// Maximum speed on a path, in rad/s and m/s.
const SPEED: [f64; 2] = [0.2, 0.05];

/// Distance from the end of a path within which it is slow, in rad and m.
const SLOW: [f64; 2] = [5.0_f64.to_radians(), 0.01];

/// Distance from the path at which a joint does not follow it, in rad and m.
const FOLLOWING: [f64; 2] = [4.0_f64.to_radians(), 0.01];

/// Way of the set point over which a joint moves by at least a count, in rad and m.
const STOPPED: [f64; 2] = [1.0_f64.to_radians(), 2.5e-3];

/// Distance from the goal at which a joint stands at it, in rad and m.
const STANDING: [f64; 2] = [0.5_f64.to_radians(), 1e-3];

/// Speed below which a joint stands, in rad/s and m/s.
const STANDING_SPEED: [f64; 2] = [0.02, 0.005];

/// Maximum frequency of the hold, in rad/s.
const MAX_FREQUENCY: f64 = 40.0;

/// Maximum product of frequency and period: more turns the phase too far at the delay of the bus.
const MAX_PHASE: f64 = 0.06;

/// Time constant of the joint rates' low pass, in periods.
const RATE_FILTER: f64 = 1.0;

/// Mass at the grip that the gains allow for, in kg: a light wrist would sink with a tool that nobody has described.
const ALLOWED_MASS: f64 = 0.2;

/// Gain of the integral, as a share of ω³.
const INTEGRAL: f64 = 0.5;

/// Force at the grip with which a hold may push, in N.
const FORCE: f64 = 3.0;

/// Minimum lever arm of that force, in m: of joints that turn the grip about itself.
const MIN_LEVER: f64 = 0.1;

/// Share of the described weight that a hold may add.
const WEIGHT: f64 = 0.4;

/// Time before a path begins, in which the hold takes over the weight, in s.
const TAKE_OVER: f64 = 1.0;

/// Speed at which an arm sinks whose hold has ended, in rad/s and m/s.
const SINKING: [f64; 2] = [0.02, 0.005];

/// Time in which the integral leaves at the end of a hold, in s.
const LEAVE: f64 = 3.0;

/// Time at the bound after which a joint is blocked, in s.
const BLOCKED: f64 = 0.3;

/// Time for which the arm must stand at its goal, in s.
const ARRIVED: f64 = 0.3;

/// Time in which the arm must arrive after the end of its path, in s.
const SETTLED: f64 = 3.0;

/// The same for an arm that swings within the tolerance, since a torque is at its bound time and again, in s.
const RESTLESS: f64 = 10.0;

/// Goal of a hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldGoal {
    /// Joint positions, in rad or m.
    pub q: JointVector,
    /// Distance from it within which a joint that is stopped has arrived, in rad or m.
    pub tolerance: JointVector,
    /// Share of the maximum speed, 0 to 1.
    pub speed: f64,
}

/// What a hold does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoldState {
    /// The deadman is open, and nothing moves.
    Waiting,
    /// On the path.
    Moving,
    /// At the goal.
    Arrived,
    /// A joint needs more torque than the hold may add.
    Blocked(Joint),
    /// A joint is not where the path is.
    NotFollowing(Joint),
}

/// State of a hold in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldOutput {
    /// What it does.
    pub state: HoldState,
    /// Goal, in rad or m.
    pub goal: JointVector,
    /// Set point, in rad or m.
    pub q_d: JointVector,
    /// Share of the path that is travelled, 0 to 1.
    pub done: f64,
}

/// Arm in one cycle, as the hold needs it.
#[derive(Clone, Copy, Debug)]
pub struct HeldArm<'a> {
    /// Joint positions, in rad or m.
    pub q: JointVector,
    /// Joint rates since the last cycle, in rad/s or m/s.
    pub qd: JointVector,
    /// Mass matrix, in kg·m², kg·m and kg.
    pub mass: SMatrix<f64, 6, 6>,
    /// Torques that carry the described weight, in N·m or N.
    pub gravity: JointVector,
    /// Jacobian of {G}, written in {G}.
    pub j_g: &'a Jacobian<6>,
}

/// Hold law, with its goal and motion.
#[derive(Clone, Copy, Debug)]
pub struct Hold {
    dt: f64,
    frequency: f64,
    kinds: [JointKind; 6],
    /// Dry friction of each joint as described, in N·m or N.
    friction: JointVector,
    goal: Option<HoldGoal>,
    motion: Option<Motion>,
    /// Joint rates after the low pass.
    qd: JointVector,
    /// Integral that leaves, and the share of it that is left.
    leaving: (JointVector, f64),
    /// What carries the arm from the end of a motion until it is let go.
    sinking: Option<Sinking>,
}

/// Springs that trail a sinking arm.
#[derive(Clone, Copy, Debug)]
struct Sinking {
    /// Where they end, in rad or m; `None` where the arm is.
    to: Option<JointVector>,
}

/// Motion along one path.
#[derive(Clone, Copy, Debug)]
struct Motion {
    path: Path<6>,
    state: HoldState,
    /// Time left before the path begins, in s.
    before: f64,
    integral: JointVector,
    /// Time for which each joint is at its bound, in s.
    at_bound: JointVector,
    standstill: Standstill,
    /// Joints that lie in the cradle.
    lies: [bool; 6],
    /// Time for which the arm stands, and since the end of the path, in s.
    standing: f64,
    since_end: f64,
}

impl Hold {
    /// Returns a hold without a goal.
    pub fn new(period: Period, kinds: [JointKind; 6], friction: JointVector) -> Self {
        let dt = period.seconds();
        Self {
            dt,
            frequency: (MAX_PHASE / dt).min(MAX_FREQUENCY),
            kinds,
            friction,
            goal: None,
            motion: None,
            qd: JointVector::zeros(),
            leaving: (JointVector::zeros(), 0.0),
            sinking: None,
        }
    }

    /// Sets the goal of the next motion, or none.
    pub fn set_goal(&mut self, goal: Option<HoldGoal>) {
        self.end();
        self.goal = goal;
    }

    /// Lets the arm go: weight that still leaves goes on to leave, and nothing else acts.
    pub const fn let_go(&mut self) {
        self.sinking = None;
    }

    /// Ends the motion at once, with all of its torque: where gravity is not compensated nothing is held.
    pub fn cut(&mut self) {
        self.motion = None;
        self.leaving = (JointVector::zeros(), 0.0);
        self.sinking = None;
        self.qd = JointVector::zeros();
    }

    /// Returns whether it has a goal, carries a sinking arm, or has weight that still leaves.
    pub const fn is_active(&self) -> bool {
        self.goal.is_some() || self.sinking.is_some() || self.leaving.1 > 0.0
    }

    /// Computes the torques beside gravity compensation, in N·m or N. It moves while `may_move`.
    pub fn torques(&mut self, arm: &HeldArm<'_>, may_move: bool) -> JointVector {
        self.qd += (arm.qd - self.qd) / (1.0 + RATE_FILTER);
        let Some(goal) = self.goal.filter(|_| may_move) else {
            self.end();
            return self.sink(arm);
        };
        let mut motion = self.motion.unwrap_or_else(|| self.begin(&goal, &arm.q));
        self.leaving.1 = 0.0;
        self.sinking = None;
        let h = if motion.is_over() {
            self.bounded(arm, motion.integral, &JointVector::zeros())
        } else {
            self.follow(&mut motion, &goal, arm)
        };
        self.motion = Some(motion);
        h
    }

    /// Returns the state of the hold; `None` without a goal.
    pub fn output(&self, q: &JointVector) -> Option<HoldOutput> {
        let goal = self.goal?;
        let output = |state, q_d, done| HoldOutput { state, goal: goal.q, q_d, done };
        Some(match &self.motion {
            Some(motion) => output(motion.state, motion.path.position(), motion.path.done()),
            None => output(HoldState::Waiting, *q, 0.0),
        })
    }

    fn begin(&self, goal: &HoldGoal, q: &JointVector) -> Motion {
        let speeds = self.each(SPEED) * goal.speed;
        Motion {
            path: Path::new(*q, goal.q, &speeds, &self.each(SLOW)),
            state: HoldState::Moving,
            before: TAKE_OVER,
            // Pressed again within three seconds: the weight is still there.
            integral: self.leaving.0 * self.leaving.1,
            at_bound: JointVector::zeros(),
            standstill: Standstill::new(q, q, &JointVector::zeros()),
            lies: [false; 6],
            standing: 0.0,
            since_end: 0.0,
        }
    }

    /// Ends the motion: its integral starts to leave, and the arm to sink.
    fn end(&mut self) {
        if let Some(motion) = self.motion.take() {
            // Of a joint in motion the integral also overcomes its dry friction, and would push it on.
            let overcome = self.friction.component_mul(&motion.path.direction());
            self.leaving = (motion.integral - overcome, 1.0);
            // A joint that something stops is not pushed on.
            let is_free = !motion.is_over() && motion.lies == [false; 6] && !motion.is_at_bound();
            self.sinking = Some(Sinking { to: is_free.then(|| motion.path.position()) });
        }
    }

    /// Returns what is left of the integral, and what lets the arm sink slowly.
    fn sink(&mut self, arm: &HeldArm<'_>) -> JointVector {
        self.leaving.1 = (self.leaving.1 - self.dt / LEAVE).max(0.0);
        let (integral, left) = self.leaving;
        if left <= 0.0 && self.sinking.is_none() {
            return JointVector::zeros();
        }
        let to = self.sinking.and_then(|sinking| sinking.to).unwrap_or(arm.q);
        let stiffness = self.mass(arm).diagonal() * (self.frequency * self.frequency);
        let slip = self.bound(arm).component_div(&stiffness);
        let trails = self.each(SINKING) * self.dt;
        let e = (to - arm.q).zip_map(&slip, |e, slip| e.clamp(-slip, slip));
        let e = e.zip_map(&trails, |e, trails| e - e.clamp(-trails, trails));
        if let Some(sinking) = &mut self.sinking {
            sinking.to = Some(arm.q + e);
        }
        self.bounded(arm, integral * left, &e)
    }

    /// Returns the torques of a spring stretched by `e` and of the damping, with an integral, within their bounds.
    fn bounded(&self, arm: &HeldArm<'_>, integral: JointVector, e: &JointVector) -> JointVector {
        let w = self.frequency;
        let wanted = integral + self.mass(arm) * (e * (w * w) - self.qd * (2.0 * w));
        wanted.zip_map(&self.bound(arm), |h, bound| h.clamp(-bound, bound))
    }

    /// Moves along the path, and returns the torques.
    fn follow(&self, motion: &mut Motion, goal: &HoldGoal, arm: &HeldArm<'_>) -> JointVector {
        let waits = motion.before > 0.0 || motion.is_at_bound();
        let (q_d, qd_d) = motion.path.advance(self.dt, !waits);
        motion.before -= self.dt;
        let mut e = q_d - arm.q;
        let mut ed = qd_d - self.qd;
        for joint in Joint::ALL {
            let is_stopped = *joint.entry(&motion.standstill.stopped());
            if is_stopped || *joint.entry(&motion.lies) {
                // It is not pushed on.
                set(&mut e, joint, 0.0);
                set(&mut ed, joint, -of(&self.qd, joint));
            }
        }
        let w = self.frequency;
        let mass = self.mass(arm);
        let wanted = mass * (e * (w * w) + ed * (2.0 * w));
        let bound = self.bound(arm);
        let wanted = wanted + motion.integral;
        let h = wanted.zip_map(&bound, |h, bound| h.clamp(-bound, bound));
        let standing = self.each(STANDING) * 0.5;
        let push = e.zip_map(&standing, |e, standing| if e.abs() > standing { e } else { 0.0 });
        let more = mass * push * (INTEGRAL * w * w * w * self.dt);
        let joints = motion.at_bound.iter_mut().zip(motion.integral.iter_mut());
        let torques = wanted.iter().zip(bound.iter()).zip(more.iter());
        for ((at_bound, integral), ((wanted, bound), more)) in joints.zip(torques) {
            if wanted.abs() >= *bound {
                *at_bound += self.dt;
            } else {
                *at_bound = 0.0;
                *integral = (*integral + more).clamp(-bound, *bound);
            }
        }
        let pushed = Pushed { torque: h, bound, friction: self.friction };
        if motion.before > 0.0 {
            // It takes over weight that it does not know.
            motion.standstill = Standstill::new(&arm.q, &q_d, &h);
        }
        motion.standstill.update(&arm.q, &q_d, &pushed, &self.each(STOPPED));
        let carried = *motion.standstill.torque();
        for (joint, _) in Joint::each(motion.standstill.stopped()).filter(|(_, stopped)| *stopped) {
            // What was added since it moved last is none of its weight.
            set(&mut motion.integral, joint, of(&carried, joint));
        }
        self.judge(motion, goal, arm, [&e, &h]);
        h
    }

    /// Decides whether a joint is blocked or does not follow, and whether the arm has arrived.
    fn judge(
        &self,
        motion: &mut Motion,
        goal: &HoldGoal,
        arm: &HeldArm<'_>,
        [e, h]: [&JointVector; 2],
    ) {
        let limits = self.each(FOLLOWING);
        let Some((joint, share)) = farthest(e, &limits) else { return };
        if share > 1.0 || share.is_nan() {
            motion.state = HoldState::NotFollowing(joint);
            return;
        }
        let off = (arm.q - goal.q).abs();
        let is_near = |joint| of(&off, joint) <= of(&goal.tolerance, joint);
        let mut stopped = Joint::each(motion.standstill.stopped());
        if let Some((joint, _)) = stopped.find(|(joint, stopped)| *stopped && !is_near(*joint)) {
            motion.state = HoldState::Blocked(joint);
            return;
        }
        let mut at_bound = Joint::each(motion.at_bound.iter());
        if let Some((joint, _)) = at_bound.find(|(_, at_bound)| **at_bound > BLOCKED) {
            motion.at_bound = JointVector::zeros();
            if is_near(joint) {
                *joint.entry_mut(&mut motion.lies) = true;
                // It is pushed as it is, and no more: it lies in a cradle, or its weight is all that the bound carries.
                set(&mut motion.integral, joint, of(h, joint));
            } else {
                motion.state = HoldState::Blocked(joint);
            }
            return;
        }
        if !motion.path.is_at_end() || motion.state == HoldState::Arrived {
            return;
        }
        motion.since_end += self.dt;
        let (standing, slow) = (self.each(STANDING), self.each(STANDING_SPEED));
        let is_slow = self.qd.iter().zip(slow.iter()).all(|(qd, slow)| qd.abs() <= *slow);
        let is_late = motion.since_end > SETTLED;
        let is_there = Joint::each(motion.lies).all(|(joint, lies)| {
            let tolerance = of(&goal.tolerance, joint);
            let near = if is_late { tolerance } else { of(&standing, joint).min(tolerance) };
            lies || of(&off, joint) <= near
        });
        motion.standing = if is_slow && is_there { motion.standing + self.dt } else { 0.0 };
        if motion.standing >= ARRIVED {
            motion.state = HoldState::Arrived;
        } else if is_late && !is_there || motion.since_end > RESTLESS {
            motion.state = HoldState::Blocked(joint);
        }
    }

    /// Returns the mass matrix with the mass that the gains allow for.
    fn mass(&self, arm: &HeldArm<'_>) -> SMatrix<f64, 6, 6> {
        let j = arm.j_g.linear;
        arm.mass + j.tr_mul(&j) * ALLOWED_MASS
    }

    /// Returns the maximum torque of the hold on each joint, in N·m or N.
    fn bound(&self, arm: &HeldArm<'_>) -> JointVector {
        let levers = arm.j_g.linear.column_iter().map(|column| column.norm().max(MIN_LEVER));
        let push = JointVector::from_iterator(levers) * FORCE;
        push + arm.gravity.abs() * WEIGHT + self.friction * 2.0
    }

    /// Returns the first value for each revolute joint, the second for each prismatic one.
    fn each(&self, values: [f64; 2]) -> JointVector {
        JointVector::from(self.kinds.map(|kind| kind.pick(values)))
    }
}

impl Motion {
    /// Returns whether nothing moves any more, because a joint was blocked or did not follow.
    const fn is_over(&self) -> bool {
        matches!(self.state, HoldState::Blocked(_) | HoldState::NotFollowing(_))
    }

    /// Returns whether a joint needs more torque than its bound.
    fn is_at_bound(&self) -> bool {
        self.at_bound.amax() > 0.0
    }
}

/// Returns the entry of a joint.
fn of(all: &JointVector, joint: Joint) -> f64 {
    all.get(joint.index()).copied().unwrap_or(f64::NAN)
}

/// Sets the entry of a joint.
fn set(all: &mut JointVector, joint: Joint, value: f64) {
    all.get_mut(joint.index()).into_iter().for_each(|entry| *entry = value);
}

/// Returns the joint farthest from its set point, in shares of its limit.
fn farthest(e: &JointVector, limits: &JointVector) -> Option<(Joint, f64)> {
    let shares = e.abs().component_div(limits);
    let farthest = Joint::each(shares.iter().copied());
    farthest.max_by(|(_, one), (_, other)| one.total_cmp(other))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3x6, Matrix6};
    use proptest::prelude::*;

    use super::*;

    const KINDS: [JointKind; 6] = [
        JointKind::Revolute,
        JointKind::Revolute,
        JointKind::Prismatic,
        JointKind::Revolute,
        JointKind::Revolute,
        JointKind::Revolute,
    ];

    /// Inertia of each joint, in kg·m² (kg), without coupling.
    const MASS: f64 = 0.1;

    /// Levers of 0.5 m, 4 N·m (N) of weight.
    fn bound(friction: f64) -> f64 {
        3.0 * 0.5 + 0.4 * 4.0 + 2.0 * friction
    }

    fn jacobian() -> Jacobian<6> {
        let linear = Matrix3x6::from_fn(|row, _| if row == 0 { 0.5 } else { 0.0 });
        Jacobian { linear, angular: Matrix3x6::zeros() }
    }

    fn arm(j_g: &Jacobian<6>, q: JointVector, qd: JointVector) -> HeldArm<'_> {
        let gravity = JointVector::repeat(-4.0);
        HeldArm { q, qd, mass: Matrix6::from_diagonal_element(MASS), gravity, j_g }
    }

    fn hold(period: f64) -> Hold {
        let mut hold = Hold::new(Period::new(period).unwrap(), KINDS, JointVector::repeat(0.1));
        let tolerance = JointVector::repeat(0.05);
        hold.set_goal(Some(HoldGoal { q: JointVector::repeat(0.5), tolerance, speed: 1.0 }));
        hold
    }

    fn any_joints(most: f64) -> impl Strategy<Value = JointVector> {
        prop::array::uniform6(-most..most).prop_map(JointVector::from)
    }

    proptest! {
        #[test]
        fn torque_is_within_its_bound_for_any_motion(
            motions in prop::collection::vec((any_joints(1.0), any_joints(20.0), any::<bool>()), 1..60)
        ) {
            let (j_g, mut hold) = (jacobian(), hold(1e-3));
            for (q, qd, may_move) in motions {
                let h = hold.torques(&arm(&j_g, q, qd), may_move);
                prop_assert!(h.amax() <= bound(0.1) + 1e-12, "{h}");
            }
        }
    }

    #[test]
    fn position_that_is_no_number_ends_the_motion() {
        let (j_g, mut hold) = (jacobian(), hold(1e-3));
        let mut q = JointVector::zeros();
        hold.torques(&arm(&j_g, q, JointVector::zeros()), true);
        q[3] = f64::NAN;
        hold.torques(&arm(&j_g, q, JointVector::zeros()), true);
        let state = hold.output(&q).unwrap().state;
        assert_eq!(state, HoldState::NotFollowing(Joint::of::<4>()));
    }

    /// Returns the time in ms of the end of a hold whose torques act `sign` times, and the greatest motion of a joint.
    fn ends(sign: f64) -> (Option<u32>, f64) {
        let (j_g, mut hold) = (jacobian(), hold(1e-3));
        let (mut q, mut qd) = (JointVector::zeros(), JointVector::zeros());
        let ended = (0..30_000).find(|_| {
            let h = hold.torques(&arm(&j_g, q, qd), true);
            let friction = qd.map(|qd| 0.1 * (qd / 1e-3).clamp(-1.0, 1.0));
            qd += (h * sign - friction) / MASS * 1e-3;
            q += qd * 1e-3;
            hold.output(&q).unwrap().state != HoldState::Moving
        });
        (ended, q.amax())
    }

    #[test]
    fn joint_whose_torque_is_reversed_is_off_the_path_before_it_is_fast() {
        let (right, _) = ends(1.0);
        assert!(right.is_some_and(|ms| ms > 3_000), "it arrives: {right:?}");
        let (wrong, moved) = ends(-1.0);
        assert!(wrong.is_some_and(|ms| ms < 1_800) && moved < 0.08, "{wrong:?}, {moved}");
    }

    #[test]
    fn frequency_falls_with_the_period() {
        for (period, frequency) in [(1e-4, MAX_FREQUENCY), (2e-3, MAX_PHASE / 2e-3)] {
            assert!((hold(period).frequency - frequency).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_acts_without_a_goal_or_before_the_deadman_is_held() {
        let (j_g, mut hold) = (jacobian(), hold(1e-3));
        let still = arm(&j_g, JointVector::zeros(), JointVector::zeros());
        assert_eq!(hold.torques(&still, false), JointVector::zeros());
        assert_eq!(hold.output(&still.q).map(|hold| hold.state), Some(HoldState::Waiting));
        hold.set_goal(None);
        assert!(!hold.is_active() && hold.output(&still.q).is_none());
    }

    #[test]
    fn weight_that_was_carried_leaves_in_three_seconds() {
        let (j_g, mut hold) = (jacobian(), hold(1e-3));
        let low = arm(&j_g, JointVector::repeat(-0.0045), JointVector::zeros());
        let high = arm(&j_g, JointVector::zeros(), JointVector::zeros());
        hold.torques(&high, true);
        (0..200).for_each(|_| _ = hold.torques(&low, true));
        let mut dropped = hold;
        dropped.cut();
        assert_eq!(dropped.torques(&low, false), JointVector::zeros());
        let carried = hold.motion.unwrap().integral;
        assert!(carried.min() > 0.1, "{carried}");
        let mut again = hold;
        let left = (0..1_500).fold(0.0, |_, _| again.torques(&high, false)[0]);
        assert!((again.torques(&high, true)[0] - left).abs() < 1e-3, "pressed again");
        let leaves: Vec<_> = (0..3_000).map(|_| hold.torques(&low, false)[0]).collect();
        assert!(leaves.windows(2).all(|pair| pair[1] <= pair[0]), "it only falls");
        assert!((leaves[1_499] - carried[0] / 2.0).abs() < 0.01 * carried[0]);
        assert!(leaves[2_999].abs() < 1e-9);
    }

    #[test]
    fn sinking_arm_is_slowed_down_and_is_not_pulled_back() {
        let (j_g, mut hold) = (jacobian(), hold(1e-3));
        let first = |value| JointVector::from_fn(|joint, _| if joint == 0 { value } else { 0.0 });
        let still = |q| arm(&j_g, first(q), JointVector::zeros());
        hold.torques(&still(0.0), true);
        hold.set_goal(None);
        let sinks = |hold: &mut Hold, cycle: u32, speed: f64| {
            let q = first(-speed * f64::from(cycle) * 1e-3);
            hold.torques(&arm(&j_g, q, first(-speed)), false)[0]
        };
        let mut slow = hold;
        let damping = (MASS + 0.05) * 2.0 * 40.0 * 0.015;
        assert!((0..1_000).all(|cycle| sinks(&mut slow, cycle, 0.015) < 2.0 * damping));
        let fast = (0..1_000).map(|cycle| sinks(&mut hold, cycle, 0.3)).fold(0.0, f64::max);
        assert!((fast - bound(0.1)).abs() < 1e-9, "at its bound: {fast}");
        // Where a hand has moved it, it stays within what the spring is stretched by at its bound.
        let at = -0.3;
        (0..900).for_each(|_| _ = hold.torques(&still(at), false));
        assert!(hold.torques(&still(at), false)[0] < 0.01 * fast, "and lets it be");
        hold.cut();
        assert!(!hold.is_active() && hold.torques(&still(at), false) == JointVector::zeros());
    }
}
