//! `[controller]`: what stands beside the paper's law. What is not written down is off.

use crate::config::control::six;
use crate::config::problem::Problems;
use crate::config::raw;
use crate::controller::Beyond;
use crate::controller::arm::Arm;
use crate::controller::assist::ContactFade;
use crate::controller::calibration::Calibration;
use crate::controller::engagement::Engagement;
use crate::controller::gains::Gains;
use crate::controller::limits::Slew;
use crate::controller::passivity::Passivity;
use crate::controller::passivity::PassivitySettings;
use crate::controller::soft_stops::SoftStops;
use crate::controller::tank::Tank;
use crate::controller::tank::TankSettings;
use crate::controller::velocity::Filter;
use crate::controller::velocity::Period;
use crate::controller::virtual_coupling::VirtualCoupling;

/// Every part that is asked for; one that cannot be is noted.
pub(super) fn beyond(
    given: &raw::Controller,
    arm: &Arm<6>,
    calibration: &Calibration<6>,
    period: Period,
    problems: &mut Problems<'_>,
) -> Beyond {
    let max_torques = calibration.max_torques();
    let filter = Filter::new(given.velocity_filter_s);
    let fade = given.contact_fade_n.map(ContactFade::new);
    let slew = given.torque_rise_s.map(|rise| Slew::new(&max_torques, rise, period));
    let soft_stops = given
        .soft_stops
        .as_ref()
        .map(|stops| SoftStops::new(arm.ranges(), &max_torques, stops.margin, stops.push));
    let part = |key: &str| format!("controller.{key}");
    Beyond {
        velocity_filter: problems.take(&part("velocity_filter_s"), filter).unwrap_or_default(),
        walls_in_pose: given.walls.as_ref().is_some_and(|walls| walls.in_pose_mode),
        contact_fade: fade.and_then(|fade| problems.take(&part("contact_fade_n"), fade)),
        engagement: given
            .engagement
            .as_ref()
            .and_then(|begin| problems.take(&part("engagement"), engagement(begin, period))),
        soft_stops: soft_stops.and_then(|stops| problems.take(&part("soft_stops"), stops)),
        slew: slew.and_then(|slew| problems.take(&part("torque_rise_s"), slew)),
        passivity: given
            .passivity
            .as_ref()
            .and_then(|passivity| problems.take(&part("passivity"), observer(passivity, period))),
        tank: given.tank.as_ref().and_then(|tank| problems.take(&part("tank"), energy_tank(tank))),
        virtual_coupling: given
            .virtual_coupling
            .as_ref()
            .and_then(|coupling| tie(coupling, period, problems)),
    }
}

fn engagement(
    given: &raw::Engagement,
    period: Period,
) -> Result<Engagement, crate::controller::engagement::InvalidEngagement> {
    let calm = match (given.calm_n, given.calm_nm) {
        (None, None) => None,
        (force, moment) => Some([force.unwrap_or(f64::MAX), moment.unwrap_or(f64::MAX)]),
    };
    Engagement::new(given.ramp_s, calm, period)
}

fn observer(
    given: &raw::Passivity,
    period: Period,
) -> Result<Passivity, crate::controller::passivity::InvalidPassivity> {
    Passivity::new(PassivitySettings {
        max_energy: given.max_energy_j,
        max_damping: given.max_damping_ns_per_m,
        lever: given.lever_m,
        calm_force: given.calm_n,
        calm_cycles: period.cycles(given.calm_s),
        is_one_sided: given.one_sided,
    })
}

fn energy_tank(given: &raw::Tank) -> Result<Tank, crate::controller::tank::InvalidTank> {
    Tank::new(TankSettings {
        initial: given.initial_j,
        min: given.min_j,
        low: given.low_j,
        max: given.max_j,
        refill: given.refill_ns_per_m_per_j,
    })
}

fn tie(
    given: &raw::VirtualCoupling,
    period: Period,
    problems: &mut Problems<'_>,
) -> Option<VirtualCoupling> {
    let stiffness = six(given.stiffness_n_per_m, given.stiffness_nm_per_rad);
    let damping = six(given.damping_ns_per_m, given.damping_nms_per_rad);
    let key = "controller.virtual_coupling";
    let stiffness = problems.take(key, Gains::new(stiffness, "stiffness"));
    let damping = problems.take(key, Gains::new(damping, "damping"));
    Some(VirtualCoupling::new(stiffness?, damping?, period))
}
