//! `[node]`, `[[bus]]`, `[switches]`, `[safety]` and what the EDS files say: who is where, what each
//! node is told, and whether it all fits on the wire.

use std::collections::HashSet;
use std::path::Path;
use std::time::Duration;

use crate::Safety;
use crate::boot;
use crate::boot::BootSettings;
use crate::joints::Joint;
use crate::lookup;
use crate::names;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::protection;
use crate::raw;
use canopen::NodeId;
use canopen::bits;
use canopen::eds::Described;
use canopen::eds::Eds;
use canopen::emcy;
use canopen::exchange;
use canopen::exchange::Exchange;
use canopen::exchange::Outbox;
use canopen::frame::Channel;
use canopen::layout;
use canopen::layout::Group;
use canopen::load;
use canopen::load::BusLoad;
use canopen::load::streams::Stream;
use canopen::object::Object;
use canopen::plan::Demand;
use canopen::plan::Identity;
use canopen::plan::NodePlan;
use canopen::plan::Watch;
use units::numbering::Joint as JointNumber;

/// Bit rates of CiA 301 (4.2), in bit/s.
const BITRATES: [u32; 8] = [10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// The longest name of a network interface.
const LONGEST_INTERFACE: usize = 15;

/// One CAN bus.
#[derive(Clone, Debug)]
pub struct BusSettings {
    /// What people call it.
    pub name: String,
    /// Its SocketCAN interface.
    pub interface: String,
    /// In bit/s.
    pub bitrate: u32,
    /// Which PDOs its drives have.
    pub layout: Layout,
    /// The most its worst case may take, in percent of the bit rate.
    pub load_limit_percent: f64,
}

/// Which PDOs the drives of a bus have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// One each way for each drive.
    #[default]
    PerDrive,
    /// One frame of targets for three drives.
    Grouped,
}

impl Layout {
    fn called(name: &str) -> Option<Self> {
        match name {
            "per-drive" => Some(Self::PerDrive),
            "grouped" => Some(Self::Grouped),
            _ => None,
        }
    }
}

/// The switch box on the network.
#[derive(Clone, Debug)]
pub struct SwitchBox {
    /// Its bus.
    pub channel: Channel,
    /// Its node-id.
    pub node: NodeId,
    /// What it must be.
    pub identity: Identity,
    /// How it is booted.
    pub boot: BootSettings,
    /// What its maker says of it.
    pub eds: Eds,
}

/// The buses.
pub(super) fn buses(raw: &raw::File, problems: &mut Problems<'_>) -> Vec<BusSettings> {
    if raw.bus.is_empty() || raw.bus.len() > 8 {
        problems.add("bus", format_args!("{} buses; there must be 1 to 8", raw.bus.len()));
    }
    names::check("bus", raw.bus.iter().map(|bus| bus.name.as_str()), problems);
    let mut interfaces = HashSet::new();
    for (place, bus) in raw.bus.iter().enumerate() {
        let key = |name: &str| format!("bus[{place}].{name}");
        if !interfaces.insert(&bus.interface) {
            problems.add(
                &key("interface"),
                format_args!("\"{}\" is taken", bus.interface.escape_debug()),
            );
        }
        if !is_interface(&bus.interface) {
            let shown = bus.interface.escape_debug();
            problems.add(&key("interface"), format_args!("\"{shown}\" is no interface"));
        }
        if !BITRATES.contains(&bus.bitrate) {
            problems.add(&key("bitrate"), format_args!("{} is none of {BITRATES:?}", bus.bitrate));
        }
        if Layout::called(&bus.layout).is_none() {
            let reason = format!("\"{}\": there are \"per-drive\" and \"grouped\"", bus.layout);
            problems.add(&key("layout"), reason);
        }
        problems.within(&key("load_limit_percent"), bus.load_limit_percent, 1.0..=100.0);
    }
    raw.bus
        .iter()
        .map(|bus| BusSettings {
            name: bus.name.clone(),
            interface: bus.interface.clone(),
            bitrate: bus.bitrate,
            layout: Layout::called(&bus.layout).unwrap_or_default(),
            load_limit_percent: bus.load_limit_percent,
        })
        .collect()
}

/// Whether Linux may have an interface of that name (`dev_valid_name`).
fn is_interface(name: &str) -> bool {
    let is_odd = |c: char| c == '/' || c == ':' || c.is_whitespace() || c.is_control();
    (1..=LONGEST_INTERFACE).contains(&name.len())
        && name != "."
        && name != ".."
        && !name.contains(is_odd)
}

/// The switch box; `None` where a problem has been noted.
pub(super) fn switch_box(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<SwitchBox> {
    let switches = &raw.switches;
    let channel = lookup::channel("switches.bus", raw, &switches.bus, problems);
    let node = lookup::node_id("switches.node_id", switches.node_id, problems);
    let eds = lookup::eds("switches.eds", file, &switches.eds, problems);
    let identity = Identity {
        vendor: switches.vendor_id,
        product: switches.product_code,
        revision: switches.revision,
    };
    let lost_ms = raw.safety.drive_lost_ms;
    let boot = boot::of_node("switches.boot", switches.boot.as_ref(), lost_ms, problems);
    Some(SwitchBox { channel: channel?, node: node?, identity, boot, eds: eds? })
}

/// Limits in time, and whether they can hold at this period.
pub(super) fn safety(raw: &raw::File, period: Duration, problems: &mut Problems<'_>) -> Safety {
    let safety = &raw.safety;
    let millis = |millis: u16| Duration::from_millis(u64::from(millis));
    if safety.rpdo_timer_ms > 0 && millis(safety.rpdo_timer_ms) < period * 2 {
        let two = (period * 2).as_micros();
        let reason = format!("{} ms is less than two periods, {two} µs", safety.rpdo_timer_ms);
        problems.add("safety.rpdo_timer_ms", reason);
    }
    node_heartbeat(raw, period, problems);
    if safety.drive_lost_ms < safety.drive_heartbeat_ms.saturating_mul(2) {
        let reason = "is less than two of the drives' heartbeats (safety.drive_heartbeat_ms)";
        problems.add("safety.drive_lost_ms", reason);
    }
    problems.within("safety.drive_heartbeat_ms", safety.drive_heartbeat_ms, 1..=10_000);
    problems.within("safety.missing_samples", safety.missing_samples, 1..=20);
    let gravity = problems.within("safety.gravity_ramp_s", safety.gravity_ramp_s, 0.01..=60.0);
    let reflection =
        problems.within("safety.reflection_ramp_s", safety.reflection_ramp_s, 0.01..=60.0);
    Safety {
        rpdo_timer_ms: safety.rpdo_timer_ms,
        node_lost_ms: safety.node_lost_ms,
        drive_heartbeat_ms: safety.drive_heartbeat_ms,
        drive_lost: millis(safety.drive_lost_ms),
        missing_samples: safety.missing_samples,
        gravity_ramp: Duration::try_from_secs_f64(gravity).unwrap_or_default(),
        reflection_ramp: Duration::try_from_secs_f64(reflection).unwrap_or_default(),
        protection: protection::protection(safety, problems),
    }
}

/// The node's heartbeat leaves with a cycle, so with no shorter interval, and with whole ones.
fn node_heartbeat(raw: &raw::File, period: Duration, problems: &mut Problems<'_>) {
    let heartbeat = Duration::from_millis(u64::from(raw.node.heartbeat_ms));
    let lost = Duration::from_millis(u64::from(raw.safety.node_lost_ms));
    if heartbeat < period {
        let (heartbeat, cycle) = (raw.node.heartbeat_ms, period.as_micros());
        let reason = format!(
            "must be at least the cycle that sends it, {cycle} µs (node.sync_period_us), got {heartbeat} ms"
        );
        problems.add("node.heartbeat_ms", reason);
    }
    let cycles = heartbeat.as_micros().div_ceil(period.as_micros().max(1)).max(1);
    let interval = period * u32::try_from(cycles).unwrap_or(u32::MAX);
    if lost < interval * 2 {
        let (two, got) = ((interval * 2).as_micros(), raw.safety.node_lost_ms);
        let reason = format!(
            "must be at least two of the node's heartbeats, which leave every {cycles} cycles: {two} µs, \
             got {got} ms; see node.heartbeat_ms"
        );
        problems.add("safety.node_lost_ms", reason);
    }
}

/// What no single section shows: node-ids taken twice, devices that are not what their EDS says or
/// cannot do what the layout asks. Returns the cyclic exchange, unless the layouts contradict each other.
pub(super) fn check(config: &Parameters, problems: &mut Problems<'_>) -> Option<Exchange> {
    let mut taken = HashSet::new();
    for place in config.channels() {
        taken.insert((place, config.node_id.raw()));
    }
    for (number, joint) in JointNumber::ALL.into_iter().zip(&config.joints) {
        let key = |name: &str| format!("joint[{}].{name}", number.index());
        if !taken.insert((joint.channel, joint.node.raw())) {
            problems
                .add(&key("node_id"), format_args!("{} is taken on this bus", joint.node.raw()));
        }
        identity(&key("product_code"), &joint.eds, &joint.identity, problems);
        abilities(&key("eds"), &joint.eds, &drive_plan(config, number, joint), problems);
    }
    if !taken.insert((config.switches.channel, config.switches.node.raw())) {
        problems.add("switches.node_id", "is taken on this bus");
    }
    identity("switches.product_code", &config.switches.eds, &config.switches.identity, problems);
    abilities("switches.eds", &config.switches.eds, &switches_plan(config), problems);
    problems.take("bus", exchange::resolve(&plans(config)))
}

/// Whether any bus carries too much.
pub(super) fn check_loads(config: &Parameters, problems: &mut Problems<'_>) {
    for (place, (bus, load)) in config.buses.iter().zip(loads(config)).enumerate() {
        let key = format!("bus[{place}].load_limit_percent");
        problems.take(&key, load.within(bus.load_limit_percent));
    }
}

/// What every node is to be and to be told: the joints' drives, then the switch box.
pub(super) fn plans(config: &Parameters) -> Vec<(Channel, NodePlan)> {
    let joints = JointNumber::ALL.into_iter().zip(&config.joints);
    let drives = joints.map(|(number, joint)| (joint.channel, drive_plan(config, number, joint)));
    drives.chain([(config.switches.channel, switches_plan(config))]).collect()
}

fn drive_plan(config: &Parameters, number: JointNumber, joint: &Joint) -> NodePlan {
    let place = number.index();
    let name = format!("joint {number} ({})", joint.name);
    let timer = protection::rpdo_timer(config, joint);
    let group = group(config, joint);
    let mut pdos = match group {
        Some(group) => layout::grouped(joint.node, place, group, timer),
        None => layout::per_drive(joint.node, timer),
    };
    layout::switch_off_others(&mut pdos, |object| joint.eds.object(object).is_some());
    let most = joint.calibration.max_target().0.unsigned_abs();
    let watch = watch(config, place);
    let plan = NodePlan::drive(name, joint.node, joint.identity, pdos, &watch, most);
    let rest = joint.calibration.span(AT_REST).saturating_add(NOISE);
    let plan = NodePlan { standstill_counts: Some(rest), ..plan };
    let plan = plan.no_faster_than(protection::motor_speed(config, place, joint));
    let plan = protection::as_far_as_it_has(plan, joint);
    let plan = match config.sync_counter {
        Some(last) => plan.counting(last),
        None => plan,
    };
    kept(config, &joint.eds, joint.boot.apply(behind_the_pdos(plan, &joint.eds)))
}

/// How far a joint at rest turns in 100 ms at most, in rad (m): no faster than 0.02 rad/s.
const AT_REST: f64 = 0.002;
/// Counts that an encoder at rest goes back and forth.
const NOISE: u32 = 2;

/// The drives that share a joint's frame of targets; `None` where each has its own.
fn group(config: &Parameters, joint: &Joint) -> Option<Group> {
    let bus = config.buses.get(usize::from(joint.channel.0))?;
    if bus.layout != Layout::Grouped {
        return None;
    }
    let here = config.joints.iter().filter(|other| other.channel == joint.channel);
    let nodes: Vec<NodeId> = here.map(|other| other.node).collect();
    let groups = nodes.iter().zip(Group::threes(&nodes));
    groups.into_iter().find_map(|(node, group)| (*node == joint.node).then_some(group))
}

/// With its emergencies behind the PDOs, where the device lets them be moved: by default they outrank
/// every PDO, and six at once would keep the torques off the bus for most of a millisecond.
fn behind_the_pdos(plan: NodePlan, eds: &Eds) -> NodePlan {
    let can_be_moved =
        eds.object(Object::EMCY_COB_ID).is_some_and(|described| described.access.is_writable());
    let low = emcy::low_cob_id(plan.node).filter(|_| can_be_moved);
    NodePlan { emcy_cob_id: low.unwrap_or(plan.emcy_cob_id), ..plan }
}

fn switches_plan(config: &Parameters) -> NodePlan {
    let SwitchBox { node, identity, boot, eds, .. } = &config.switches;
    let mut plan = NodePlan::switches(
        "switch box".to_owned(),
        *node,
        *identity,
        &watch(config, config.joints.len()),
    );
    layout::switch_off_others(&mut plan.pdos, |object| eds.object(object).is_some());
    kept(config, eds, boot.apply(behind_the_pdos(plan, eds)))
}

/// Whether a node keeps what it is told, and forgets first what it was told before. One that cannot,
/// by its EDS, has nothing to forget.
fn kept(config: &Parameters, eds: &Eds, plan: NodePlan) -> NodePlan {
    let can_forget = eds.object(Object::RESTORE_DEFAULTS).is_some();
    NodePlan {
        stores_configuration: config.stores_configuration,
        restores_defaults: config.restores_defaults && can_forget,
        ..plan
    }
}

/// How the node at `place` is watched. Each beats a hundredth faster than the one before, so that those
/// of all nodes, which begin together, do not stay together: the next SYNC would have to wait for them.
fn watch(config: &Parameters, place: usize) -> Watch {
    let place = u16::try_from(place).unwrap_or(u16::MAX);
    let period = config.safety.drive_heartbeat_ms;
    let lost = u16::try_from(config.safety.drive_lost.as_millis()).unwrap_or(u16::MAX);
    Watch {
        master: config.node_id,
        master_lost_ms: config.safety.node_lost_ms,
        heartbeat_ms: period - (period / 100).saturating_mul(place).min(period / 2),
        node_lost_ms: lost,
    }
}

/// The configured device must be the one the EDS describes.
fn identity(key: &str, eds: &Eds, identity: &Identity, problems: &mut Problems<'_>) {
    let Identity { vendor, product, .. } = *identity;
    let (eds_vendor, eds_product) = (eds.vendor(), eds.product());
    if (vendor, product) != (eds_vendor, eds_product) {
        let reason = format!(
            "vendor {vendor:08X}h product {product:08X}h is not what its EDS describes: \
             vendor {eds_vendor:08X}h product {eds_product:08X}h"
        );
        problems.add(key, reason);
    }
}

/// The worst case of each bus.
pub(super) fn loads(config: &Parameters) -> Vec<BusLoad> {
    let buses = (0..).map(Channel).zip(&config.buses);
    let load = |(channel, bus): (Channel, &BusSettings)| {
        BusLoad::of(&streams(config, channel), bus.bitrate, period_us(config))
    };
    buses.map(load).collect()
}

/// What is planned on one bus.
fn streams(config: &Parameters, channel: Channel) -> Vec<Stream> {
    let plans = plans(config);
    let here = plans.iter().filter(|(place, _)| *place == channel).map(|(_, plan)| plan);
    load::streams(here, period_us(config), config.node_id, heartbeat_ms(config))
}

/// From SYNC to SYNC, in µs.
pub(super) fn period_us(config: &Parameters) -> u32 {
    u32::try_from(config.period.as_micros()).unwrap_or(u32::MAX)
}

/// From one heartbeat of the master to the next, in ms.
pub(super) fn heartbeat_ms(config: &Parameters) -> u16 {
    u16::try_from(config.heartbeat.as_millis()).unwrap_or(u16::MAX)
}

/// How long the RPDOs of every cycle take on the slowest bus, in the worst case.
pub(super) fn rpdo_time(config: &Parameters, outbox: &Outbox) -> Duration {
    let time = |(channel, bus): (Channel, &BusSettings)| {
        let bits: u32 = outbox.bytes_on(channel).map(bits::worst_case).sum();
        Duration::from_secs(1) * bits / bus.bitrate.max(1)
    };
    (0..).map(Channel).zip(&config.buses).map(time).max().unwrap_or_default()
}

/// The device must have, by its EDS, every object that is to be set in it.
fn abilities(key: &str, eds: &Eds, plan: &NodePlan, problems: &mut Problems<'_>) {
    for (object, demand) in plan.demands() {
        if eds.object(object).is_none() && demand != Demand::Skip {
            problems.add(key, format_args!("{}: {object} is not in its EDS", plan.name));
        } else if !is_able(eds, object, demand) {
            problems.add(key, format_args!("{}: {object} cannot be {demand}", plan.name));
        }
    }
}

fn is_able(eds: &Eds, object: Object, demand: Demand) -> bool {
    let can = |is: fn(&Described) -> bool| eds.object(object).is_some_and(is);
    match demand {
        Demand::Write => can(|described| described.access.is_writable()),
        Demand::Transmit => can(|described| described.is_mappable && described.access.is_input()),
        Demand::Receive => can(|described| described.is_mappable && described.access.is_output()),
        Demand::Skip => eds.dummy(object.index),
    }
}
