//! `[controller]`: what stands beside the paper's law. What is not written down is off, but for one: what is
//! felt always begins by a ramp.

use crate::problem::Problems;
use crate::raw;
use crate::raw::six;
use controller::Extensions;
use controller::arm::Arm;
use controller::assist::ContactFade;
use controller::calibration::Calibration;
use controller::engagement::Engagement;
use controller::gains::Gains;
use controller::limits::Slew;
use controller::passivity::Passivity;
use controller::passivity::PassivitySettings;
use controller::period::Period;
use controller::soft_stops::SoftStops;
use controller::tank::Tank;
use controller::tank::TankSettings;
use controller::velocity::Filter;
use controller::virtual_coupling::VirtualCoupling;

/// What is felt begins over so many s if nothing else is asked for.
const BEGINS_OVER: f64 = 0.3;

/// Strongest damper of a tank of which the file says none, in N·s/m: that of the shipped passivity layers.
const TANK_DAMPING: f64 = 60.0;

/// Every part that is asked for; one that cannot be is noted.
pub(super) fn extensions(
    given: &raw::Controller,
    arm: &Arm<6>,
    calibration: &Calibration<6>,
    period: Period,
    problems: &mut Problems<'_>,
) -> Extensions {
    let max_torques = calibration.max_torques();
    let filter = Filter::new(given.velocity_filter_s);
    let fade = given.contact_fade_n.map(ContactFade::new);
    let slew = given.torque_rise_s.map(|rise| Slew::new(&max_torques, rise, period));
    Extensions {
        velocity_filter: problems.take("controller.velocity_filter_s", filter).unwrap_or_default(),
        walls_in_pose: given.walls.as_ref().is_some_and(|walls| walls.in_pose_mode),
        contact_fade: fade.and_then(|fade| problems.take("controller.contact_fade_n", fade)),
        engagement: match &given.engagement {
            Some(given) => engagement(given, period, problems),
            None => Engagement::new(BEGINS_OVER, None, period).ok(),
        },
        soft_stops: given.soft_stops.as_ref().and_then(|given| {
            let margin = problems.within("controller.soft_stops.margin", given.margin, 1e-3..=0.5);
            let push = problems.within("controller.soft_stops.push", given.push, 0.0..=1.0);
            let capacities = calibration.coupling().capacities(&max_torques);
            SoftStops::new(arm.ranges(), &capacities, margin, push).ok()
        }),
        slew: slew.and_then(|slew| problems.take("controller.torque_rise_s", slew)),
        passivity: given.passivity.as_ref().and_then(|given| observer(given, period, problems)),
        tank: given.tank.as_ref().and_then(|given| tank(given, problems)),
        virtual_coupling: given
            .virtual_coupling
            .as_ref()
            .and_then(|given| virtual_coupling(given, period, problems)),
    }
}

// Each number is looked at under its own key first; what is left for the part itself is how they fit
// together.

fn engagement(
    given: &raw::Engagement,
    period: Period,
    problems: &mut Problems<'_>,
) -> Option<Engagement> {
    let ramp = problems.within("controller.engagement.ramp_s", given.ramp_s, 0.0..=10.0);
    let force = given.calm_n.map(|force| problems.positive("controller.engagement.calm_n", force));
    let moment =
        given.calm_nm.map(|moment| problems.positive("controller.engagement.calm_nm", moment));
    let calm = match (force, moment) {
        (None, None) => None,
        (force, moment) => Some([force.unwrap_or(f64::MAX), moment.unwrap_or(f64::MAX)]),
    };
    Engagement::new(ramp, calm, period).ok()
}

fn observer(
    given: &raw::Passivity,
    period: Period,
    problems: &mut Problems<'_>,
) -> Option<Passivity> {
    let mut above_zero = |key: &str, value| {
        problems.within(&format!("controller.passivity.{key}"), value, 1e-6..=1e6)
    };
    let settings = PassivitySettings {
        max_energy: above_zero("max_energy_j", given.max_energy_j),
        max_damping: above_zero("max_damping_ns_per_m", given.max_damping_ns_per_m),
        lever: above_zero("lever_m", given.lever_m),
        calm_force: above_zero("calm_n", given.calm_n),
        calm_cycles: period.cycles(above_zero("calm_s", given.calm_s)),
        is_one_sided: given.one_sided,
    };
    Passivity::new(settings).ok()
}

fn tank(given: &raw::Tank, problems: &mut Problems<'_>) -> Option<Tank> {
    let before = problems.count();
    let mut number =
        |key: &str, value| problems.within(&format!("controller.tank.{key}"), value, 0.0..=1e6);
    let settings = TankSettings {
        initial: number("initial_j", given.initial_j),
        min: number("min_j", given.min_j),
        low: number("low_j", given.low_j),
        max: number("max_j", given.max_j),
        refill: number("refill_ns_per_m_per_j", given.refill_ns_per_m_per_j),
        max_damping: number(
            "max_damping_ns_per_m",
            given.max_damping_ns_per_m.unwrap_or(TANK_DAMPING),
        ),
    };
    problems.take_unless_noted(before, "controller.tank", Tank::new(settings))
}

fn virtual_coupling(
    given: &raw::VirtualCoupling,
    period: Period,
    problems: &mut Problems<'_>,
) -> Option<VirtualCoupling> {
    let mut three = |key: &str, values| {
        problems.none_negative(&format!("controller.virtual_coupling.{key}"), values)
    };
    let stiffness = six(
        three("stiffness_n_per_m", given.stiffness_n_per_m.0),
        three("stiffness_nm_per_rad", given.stiffness_nm_per_rad.0),
    );
    let damping = six(
        three("damping_ns_per_m", given.damping_ns_per_m.0),
        three("damping_nms_per_rad", given.damping_nms_per_rad.0),
    );
    let stiffness = Gains::new(stiffness, "stiffness").ok()?;
    let damping = Gains::new(damping, "damping").ok()?;
    Some(VirtualCoupling::new(stiffness, damping, period))
}
