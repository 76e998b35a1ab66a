//! Checks that the EDS of each drive supports the PDO layout of its bus; otherwise proposes layouts with rate, load and
//! force.

use std::collections::HashMap;
use std::time::Duration;

use crate::buses::Layout;
use crate::force_cap::{Dampers, ForceCap};
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::{plans, raw};
use canopen::frame::Channel;
use canopen::load::lacks::{self, Lack};
use canopen::load::network::{Assumptions, Bus, Network};
use canopen::load::proposals;
use units::numbering::Joint;

/// Reports every node that lacks parts of its layout, with the layouts that fit.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let mut variants: HashMap<Channel, Vec<Variant>> = HashMap::new();
    let joints = Joint::ALL.into_iter().zip(&config.joints);
    for ((number, joint), raw) in joints.zip(raw.joint.all()) {
        let plan = plans::drive(config, number, joint);
        let (missing, channel) = (lacks::lacks(&joint.eds, joint.node, &plan.pdos), joint.channel);
        let bus = config.buses.get(usize::from(channel.0)).filter(|_| !missing.is_empty());
        let Some(bus) = bus else { continue };
        let variants = variants.entry(channel).or_insert_with(|| variants_of(config, channel));
        let reason = format!(
            "its drive cannot have layout \"{}\": its EDS lacks {}; {}",
            bus.layout.name(),
            lacks::listed(&missing),
            remedy(variants, number, &bus.name),
        );
        problems.add_of(plan.name.clone(), &raw.eds, reason);
    }
    if let Some((switches, raw)) = config.switches.as_ref().zip(raw.switches.as_ref()) {
        let missing =
            lacks::lacks(&switches.eds, switches.node, &plans::switches(config, switches).pdos);
        if !missing.is_empty() {
            let missing = lacks::listed(&missing);
            problems.add(&raw.eds, format_args!("switch box: its EDS lacks {missing}"));
        }
    }
}

/// Another layout of one bus.
struct Variant {
    layout: Layout,
    /// Missing parts of each drive on the bus.
    drives: Vec<(Joint, Vec<Lack>)>,
    /// Figures at the highest proposed rate up to the configured one; `None` if no rate is low enough.
    figures: Option<Figures>,
}

/// Rate, load and force that a layout allows.
struct Figures {
    hz: f64,
    load_percent: f64,
    /// Maximum sum of forces, in N.
    max_force: f64,
    /// Maximum sum of forces without dampers that reverse the motion of the hand, in N.
    undamped_force: f64,
}

impl Figures {
    /// Writes `500 Hz, 76 % of joints, 20 N`.
    fn on(&self, bus: &str) -> String {
        let Self { hz, load_percent, max_force, undamped_force } = self;
        let weaker = if undamped_force > max_force {
            format!(" ({undamped_force} N with weaker dampers)")
        } else {
            String::new()
        };
        format!("{hz:.0} Hz, {load_percent:.0} % of {bus}, {max_force} N{weaker}")
    }
}

/// Returns the other layouts of one bus.
fn variants_of(config: &Parameters, channel: Channel) -> Vec<Variant> {
    let place = usize::from(channel.0);
    let present = config.buses.get(place).map(|bus| bus.layout);
    let others = Layout::ALL.into_iter().filter(|layout| Some(*layout) != present);
    let variant = |layout| {
        let mut config = config.clone();
        if let Some(bus) = config.buses.get_mut(place) {
            bus.layout = layout;
        }
        let joints = Joint::ALL.into_iter().zip(&config.joints);
        let here = joints.filter(|(_, joint)| joint.channel == channel);
        let missing = here.map(|(number, joint)| {
            (
                number,
                lacks::lacks(&joint.eds, joint.node, &plans::drive(&config, number, joint).pdos),
            )
        });
        Variant { layout, drives: missing.collect(), figures: figures(&config, place) }
    };
    others.map(variant).collect()
}

/// Returns the figures of one bus, with the drives' timers adapted to its rate.
fn figures(config: &Parameters, place: usize) -> Option<Figures> {
    let network = config.network();
    let bus: Bus = network.buses.get(place)?.clone();
    let alone = Network { buses: vec![bus], ..network };
    let period_us = proposals::fitting_period(&alone, &Assumptions::default())?;
    let slowed = slowed(config, period_us);
    let (cap, reaction_time) = (slowed.force_cap(), slowed.planned_reaction_time());
    let load = Network { period_us, ..alone }.loads().into_iter().next()?;
    Some(Figures {
        hz: 1e6 / f64::from(period_us.max(1)),
        load_percent: load.percent(),
        max_force: cap.max_force(reaction_time),
        undamped_force: ForceCap { dampers: Dampers::default(), ..cap }.max_force(reaction_time),
    })
}

/// Returns the configuration with another period, and timers of at least two periods.
fn slowed(config: &Parameters, period_us: u32) -> Parameters {
    let mut slowed = config.clone();
    slowed.period = Duration::from_micros(period_us.into());
    let two_periods_ms = u16::try_from(period_us.saturating_mul(2).div_ceil(1_000));
    let two_periods_ms = two_periods_ms.unwrap_or(u16::MAX);
    let safety = &mut slowed.safety;
    safety.node_lost_ms = safety.node_lost_ms.max(two_periods_ms);
    if safety.rpdo_timer_ms > 0 {
        safety.rpdo_timer_ms = safety.rpdo_timer_ms.max(two_periods_ms);
    }
    slowed
}

/// Returns the layouts that fit, or else the obstacles of every layout, in words.
fn remedy(variants: &[Variant], number: Joint, bus: &str) -> String {
    let fitting = variants.iter().filter(|it| it.drives.iter().all(|(_, lacks)| lacks.is_empty()));
    let fitting = fitting.filter_map(|variant| {
        let figures = variant.figures.as_ref()?.on(bus);
        Some(format!("\"{}\" at {figures}", variant.layout.name()))
    });
    let fitting: Vec<String> = fitting.collect();
    if fitting.is_empty() {
        let obstacles: Vec<String> = variants.iter().map(|it| it.obstacle(number, bus)).collect();
        format!("no layout fits: {}", obstacles.join("; "))
    } else {
        format!("layouts that fit: {}", fitting.join("; "))
    }
}

impl Variant {
    /// Returns the obstacle of the layout in words: missing parts of this drive, else another drive, else the load.
    fn obstacle(&self, number: Joint, bus: &str) -> String {
        let name = self.layout.name();
        let unable = || self.drives.iter().filter(|(_, lacks)| !lacks.is_empty());
        let own = unable().find(|(drive, _)| *drive == number);
        match (own, unable().next()) {
            (Some((_, own)), _) => {
                format!("for \"{name}\" the drive would need {}", lacks::listed(own))
            }
            (None, Some((other, _))) => format!("joint {other} cannot have \"{name}\""),
            (None, None) => format!("\"{name}\" is above the load limit of {bus} at any rate"),
        }
    }
}
