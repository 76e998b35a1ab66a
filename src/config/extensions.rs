//! `[controller]`: extensions to the control law of the paper. An absent extension is off, except the engagement ramp
//! of reflection.

use crate::joints::JointParameters;
use crate::problem::Problems;
use crate::raw::{self, six};
use crate::value::Value;
use controller::Extensions;
use controller::arm::{Arm, JointKind};
use controller::assist::ContactFade;
use controller::calibration::Calibration;
use controller::engagement::Engagement;
use controller::friction::{FrictionCompensation, FrictionSettings, MAX_SHARE};
use controller::gains::Gains;
use controller::limits::Slew;
use controller::passivity::{Passivity, PassivitySettings};
use controller::period::Period;
use controller::soft_stops::SoftStops;
use controller::tank::{Tank, TankSettings};
use controller::velocity::Filter;
use controller::virtual_coupling::VirtualCoupling;

/// Default duration of the ramp by which reflection begins, in s.
const DEFAULT_RAMP_S: f64 = 0.3;

/// Default presliding distance of a joint, in rad or m.
const PRESLIDING_RAD: f64 = 0.5e-3;
const PRESLIDING_M: f64 = 0.15e-3;

/// Default maximum damping of the tank, in N·s/m, as in the shipped passivity layers.
const TANK_DAMPING: f64 = 60.0;

/// Joints, arm, calibration and period that the extensions depend on; each `None` after a problem.
#[derive(Clone, Copy)]
pub(super) struct Basis<'m> {
    pub(super) joints: Option<&'m [JointParameters; 6]>,
    pub(super) arm: Option<&'m Arm<6>>,
    pub(super) calibration: Option<&'m Calibration<6>>,
    pub(super) period: Option<Period>,
}

/// Reads the configured extensions. An invalid one is noted as a problem and left out.
pub(super) fn extensions(
    given: &raw::Controller,
    made: Basis<'_>,
    problems: &mut Problems<'_>,
) -> Extensions {
    let period = made.period;
    let filter = given
        .velocity_filter_s
        .get()
        .and_then(|seconds| problems.take(&given.velocity_filter_s, Filter::new(seconds)));
    let contact_fade = given
        .contact_fade_n
        .get()
        .and_then(|force| problems.take(&given.contact_fade_n, ContactFade::new(force)));
    Extensions {
        velocity_filter: filter.unwrap_or_default(),
        walls_in_pose: given.walls.as_ref().and_then(|walls| walls.in_pose_mode.get())
            == Some(true),
        contact_fade,
        damping_never_pulls: given.damping_never_pulls.or(false).get() == Some(true),
        engagement: match &given.engagement {
            Some(given) => engagement(given, period, problems),
            None => period.and_then(|period| Engagement::new(DEFAULT_RAMP_S, None, period).ok()),
        },
        soft_stops: given.soft_stops.as_ref().and_then(|given| soft_stops(given, made, problems)),
        slew: slew(given, made, problems),
        friction: given.friction.as_ref().and_then(|given| friction(given, made, problems)),
        passivity: given.passivity.as_ref().and_then(|given| observer(given, period, problems)),
        tank: given.tank.as_ref().and_then(|given| tank(given, problems)),
        virtual_coupling: given
            .virtual_coupling
            .as_ref()
            .and_then(|given| virtual_coupling(given, period, problems)),
    }
}

// Each number is checked at its own key first. The constructor then checks the combination.

fn engagement(
    given: &raw::Engagement,
    period: Option<Period>,
    problems: &mut Problems<'_>,
) -> Option<Engagement> {
    let ramp = problems.within(&given.ramp_s, 0.0..=10.0);
    let force = problems.positive(&given.wait_below_n);
    let moment = problems.positive(&given.wait_below_nm);
    let wait_below = match (force, moment) {
        (None, None) => None,
        (force, moment) => Some([force.unwrap_or(f64::MAX), moment.unwrap_or(f64::MAX)]),
    };
    Engagement::new(ramp?, wait_below, period?).ok()
}

fn soft_stops(
    given: &raw::SoftStops,
    made: Basis<'_>,
    problems: &mut Problems<'_>,
) -> Option<SoftStops<6>> {
    let margin = problems.within(&given.margin, 1e-3..=0.5);
    let push = problems.within(&given.push, 0.0..=1.0);
    let calibration = made.calibration?;
    let capacities = calibration.coupling().capacities(&calibration.max_torques());
    SoftStops::new(made.arm?.ranges(), &capacities, margin?, push?).ok()
}

/// Reads the compensation of the configured friction of the joints.
fn friction(
    given: &raw::FrictionCompensation,
    made: Basis<'_>,
    problems: &mut Problems<'_>,
) -> Option<FrictionCompensation> {
    let share = problems.within(&given.share, 0.0..=MAX_SHARE);
    let turning = problems.within(&given.presliding_rad.or(PRESLIDING_RAD), 1e-4..=0.1);
    let sliding = problems.within(&given.presliding_m.or(PRESLIDING_M), 1e-5..=0.02);
    let (joints, [turning, sliding]) = (made.joints?, [turning?, sliding?]);
    let presliding = joints.each_ref().map(|joint| match joint.plant.link.kind {
        JointKind::Revolute => turning,
        JointKind::Prismatic => sliding,
    });
    let settings = FrictionSettings {
        share: share?,
        coulomb: joints.each_ref().map(|joint| joint.plant.friction.coulomb).into(),
        viscous: joints.each_ref().map(|joint| joint.plant.friction.viscous).into(),
        presliding: presliding.into(),
    };
    FrictionCompensation::new(settings).ok()
}

fn slew(given: &raw::Controller, made: Basis<'_>, problems: &mut Problems<'_>) -> Option<Slew<6>> {
    let (rise, max_torques) = (given.torque_rise_s.get()?, made.calibration?.max_torques());
    problems.take(&given.torque_rise_s, Slew::new(&max_torques, rise, made.period?))
}

fn observer(
    given: &raw::Passivity,
    period: Option<Period>,
    problems: &mut Problems<'_>,
) -> Option<Passivity> {
    let mut above_zero = |value: &Value<f64>| problems.within(value, 1e-6..=1e6);
    let max_energy = above_zero(&given.max_energy_j);
    let max_damping = above_zero(&given.max_damping_ns_per_m);
    let lever = above_zero(&given.lever_m);
    let threshold = above_zero(&given.contact_threshold_n);
    let release = above_zero(&given.contact_release_s);
    let settings = PassivitySettings {
        max_energy: max_energy?,
        max_damping: max_damping?,
        lever: lever?,
        contact_threshold: threshold?,
        contact_release_cycles: period?.cycles(release?),
        is_one_sided: given.one_sided.or(true).get()?,
    };
    Passivity::new(settings).ok()
}

fn tank(given: &raw::Tank, problems: &mut Problems<'_>) -> Option<Tank> {
    let before = problems.count();
    let mut number = |value: &Value<f64>| problems.within(value, 0.0..=1e6);
    let initial = number(&given.initial_j);
    let min = number(&given.min_j);
    let low = number(&given.low_j);
    let max = number(&given.max_j);
    let refill = number(&given.refill_ns_per_m_per_j);
    let max_damping = number(&given.max_damping_ns_per_m.or(TANK_DAMPING));
    let settings = TankSettings {
        initial: initial?,
        min: min?,
        low: low?,
        max: max?,
        refill: refill?,
        max_damping: max_damping?,
    };
    problems.take_unless_noted(before, given, Tank::new(settings))
}

fn virtual_coupling(
    given: &raw::VirtualCoupling,
    period: Option<Period>,
    problems: &mut Problems<'_>,
) -> Option<VirtualCoupling> {
    let before = problems.count();
    // Without a spring on each axis the object would not follow its command.
    let [k_linear, k_angular] = [&given.stiffness_n_per_m, &given.stiffness_nm_per_rad]
        .map(|value| problems.all_positive(value));
    let [d_linear, d_angular] = [&given.damping_ns_per_m, &given.damping_nms_per_rad]
        .map(|value| problems.none_negative(value));
    let stiffness = Gains::new(six(k_linear?, k_angular?), "stiffness");
    let damping = Gains::new(six(d_linear?, d_angular?), "damping");
    let stiffness = problems.take_unless_noted(before, &given.stiffness_n_per_m, stiffness);
    let damping = problems.take_unless_noted(before, &given.damping_ns_per_m, damping);
    Some(VirtualCoupling::new(stiffness?, damping?, period?))
}
