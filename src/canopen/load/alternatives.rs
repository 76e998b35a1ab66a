//! The same network with something done differently: the layouts and moves that
//! [`proposals`](crate::load::proposals) weighs, and that one may ask for.

use std::fmt;

use canopen_rs::NodeId;

use crate::emcy;
use crate::layout;
use crate::layout::Direction;
use crate::layout::Group;
use crate::layout::Pdo;
use crate::load::abilities::NoGroup;
use crate::load::network::Bus;
use crate::load::network::Member;
use crate::load::network::Network;
use crate::load::utilisation::BusLoad;
use crate::plan::ErrorControl;
use crate::plan::NodePlan;

/// A heartbeat that suffices where a drive also watches its RPDO, in ms.
const SLOW_HEARTBEAT_MS: u16 = 100;

/// One thing done differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// One RPDO and one TPDO a drive, both at every SYNC.
    PerDrive,
    /// Three drives listen to one torque RPDO; states go on change.
    Grouped,
    /// Statusword and controlword go on change, each in a PDO of its own.
    StatesOnChange,
    /// Half of a bus's drives move to another one.
    SecondBus,
    /// SYNC comes every so many µs.
    Period(u32),
    /// Nodes that watch their RPDO, or nothing, send their heartbeat every 100 ms.
    SlowHeartbeats,
    /// Emergencies have identifiers behind the cycle's.
    EmergenciesMoved,
}

/// In words.
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PerDrive => f.write_str("one RPDO and one TPDO a drive"),
            Self::Grouped => f.write_str("three torques in one RPDO"),
            Self::StatesOnChange => f.write_str("statusword and controlword on change"),
            Self::SecondBus => f.write_str("a second bus for half of the drives"),
            Self::Period(period_us) => {
                write!(f, "{:.0} Hz", 1e6 / f64::from((*period_us).max(1)))
            }
            Self::SlowHeartbeats => {
                write!(f, "the nodes' heartbeats every {SLOW_HEARTBEAT_MS} ms")
            }
            Self::EmergenciesMoved => f.write_str("emergencies behind the PDOs"),
        }
    }
}

/// A drive that cannot do what would help.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Obstacle {
    /// Its name.
    pub drive: String,
    /// Why it cannot listen to a shared RPDO.
    pub reason: NoGroup,
}

/// `network` with `changes` done to it, one after the other; `None` where one of them cannot be done or
/// changes nothing.
pub fn changed(network: &Network, changes: &[Change]) -> Option<Network> {
    changes.iter().try_fold(network.clone(), |network, change| {
        let done = match change {
            Change::PerDrive => Some(on_every_bus(&network, per_drive)),
            Change::Grouped => {
                obstacles(&network).is_empty().then(|| on_every_bus(&network, grouped))
            }
            Change::StatesOnChange => Some(on_every_bus(&network, states_on_change)),
            Change::SecondBus => Some(split(&network)),
            Change::Period(period_us) => Some(Network { period_us: *period_us, ..network.clone() }),
            Change::SlowHeartbeats => Some(on_every_bus(&network, slow_heartbeats)),
            Change::EmergenciesMoved => Some(emergencies_moved(&network)),
        };
        done.filter(|done| *done != network)
    })
}

/// The drives that keep torques from being grouped.
pub fn obstacles(network: &Network) -> Vec<Obstacle> {
    let drives =
        network.buses.iter().flat_map(|bus| &bus.members).filter(|member| member.plan.is_drive());
    let of = |member: &Member| {
        let name = member.plan.name.clone();
        let reasons = member.abilities.no_group.clone();
        reasons.into_iter().map(move |reason| Obstacle { drive: name.clone(), reason })
    };
    drives.flat_map(of).collect()
}

fn on_every_bus(network: &Network, change: fn(&[NodePlan]) -> Vec<NodePlan>) -> Network {
    let mut changed = network.clone();
    for bus in &mut changed.buses {
        let plans: Vec<NodePlan> = bus.members.iter().map(|member| member.plan.clone()).collect();
        for (member, plan) in bus.members.iter_mut().zip(change(&plans)) {
            member.plan = plan;
        }
    }
    changed
}

/// Every bus that carries too much as two, or every bus where none does: the first half of its drives on
/// one, everything else on the other.
fn split(network: &Network) -> Network {
    let loads = network.loads();
    let buses = network.buses.iter().zip(loads);
    let is_crowded = |(bus, load): &(&Bus, BusLoad)| load.within(bus.load_limit_percent).is_err();
    let none_is = !buses.clone().any(|bus| is_crowded(&bus));
    let parts = |bus| if none_is || is_crowded(&bus) { halves(bus.0) } else { vec![bus.0.clone()] };
    Network { buses: buses.flat_map(parts).collect(), ..network.clone() }
}

/// A bus as two; as it is if one of them would be empty.
fn halves(bus: &Bus) -> Vec<Bus> {
    let drives = bus.members.iter().filter(|member| member.plan.is_drive()).count();
    let stay = drives.div_ceil(2);
    let mut placed = 0;
    let stays = |member: &Member| {
        placed += usize::from(member.plan.is_drive());
        member.plan.is_drive() && placed <= stay
    };
    let (first, second): (Vec<_>, Vec<_>) = bus.members.iter().cloned().partition(stays);
    if first.is_empty() || second.is_empty() {
        return vec![bus.clone()];
    }
    let name = format!("{} 2", bus.name);
    vec![Bus { members: first, ..bus.clone() }, Bus { name, members: second, ..bus.clone() }]
}

fn emergencies_moved(network: &Network) -> Network {
    let mut moved = network.clone();
    let members = moved.buses.iter_mut().flat_map(|bus| &mut bus.members);
    for member in members.filter(|member| member.abilities.moves_emergencies) {
        let plan = &mut member.plan;
        plan.emcy_cob_id = emcy::low_cob_id(plan.node).unwrap_or(plan.emcy_cob_id);
    }
    moved
}

/// Each drive's RPDO timer guards the torque, so the heartbeat is only for the rest of the node. How many
/// may be missed stays as it is.
fn slow_heartbeats(plans: &[NodePlan]) -> Vec<NodePlan> {
    let slow = |plan: &NodePlan| {
        let is_guarded = !plan.is_drive() || rpdo_timer_ms(plan).is_some();
        let ErrorControl::Heartbeat { period_ms, lost_after } = plan.error_control else {
            return plan.clone();
        };
        if !is_guarded || period_ms == 0 || period_ms >= SLOW_HEARTBEAT_MS {
            return plan.clone();
        }
        let lost_after = lost_after * u32::from(SLOW_HEARTBEAT_MS) / period_ms.into();
        let error_control = ErrorControl::Heartbeat { period_ms: SLOW_HEARTBEAT_MS, lost_after };
        NodePlan { error_control, ..plan.clone() }
    };
    plans.iter().map(slow).collect()
}

/// How long a drive waits for its first RPDO, if it has such a timer.
fn rpdo_timer_ms(plan: &NodePlan) -> Option<u16> {
    let mut rpdos = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive);
    rpdos.find_map(|pdo| pdo.service.as_ref()?.event_timer_ms)
}

/// The nodes of one bus, each drive with a pair of PDOs of its own.
fn per_drive(plans: &[NodePlan]) -> Vec<NodePlan> {
    laid_out(plans, |_, node, _, timer| layout::per_drive(node, timer))
}

/// The nodes of one bus with torques in groups.
fn grouped(plans: &[NodePlan]) -> Vec<NodePlan> {
    laid_out(plans, |place, node, group, timer| layout::grouped(node, place, group, timer))
}

/// The nodes of one bus as if they were grouped, every drive being a group of its own.
fn states_on_change(plans: &[NodePlan]) -> Vec<NodePlan> {
    laid_out(plans, |place, node, _, timer| {
        let alone = Group { cob_id: layout::rpdo1(node), size: 1, slot: 0 };
        layout::grouped(node, place, alone, timer)
    })
}

/// The nodes of one bus, each drive with the PDOs that `pdos` has for its place among them, its node,
/// its group and its RPDO timer. What is off beside those stays off.
fn laid_out(
    plans: &[NodePlan],
    pdos: impl Fn(usize, NodeId, Group, Option<u16>) -> Vec<Pdo>,
) -> Vec<NodePlan> {
    let drives = plans.iter().filter(|plan| plan.is_drive()).map(|plan| plan.node);
    let drives: Vec<NodeId> = drives.collect();
    let groups = Group::threes(&drives);
    let mut changed = plans.to_vec();
    let drives = changed.iter_mut().filter(|plan| plan.is_drive());
    for (place, (plan, group)) in drives.zip(groups).enumerate() {
        let mut laid_out = pdos(place, plan.node, group, rpdo_timer_ms(plan));
        let is_new = |pdo: &Pdo| {
            !laid_out.iter().any(|one| (one.direction, one.number) == (pdo.direction, pdo.number))
        };
        let others: Vec<Pdo> = plan.pdos.iter().filter(|pdo| is_new(pdo)).cloned().collect();
        laid_out.extend(others);
        plan.pdos = laid_out;
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::network::tests::network;
    use crate::load::network::tests::six_drives_and_switches;
    use crate::object::Object;

    fn overloaded() -> Network {
        network(six_drives_and_switches(), 1_000)
    }

    fn plans(network: &Network) -> Vec<&NodePlan> {
        network.buses.iter().flat_map(|bus| &bus.members).map(|member| &member.plan).collect()
    }

    #[test]
    fn a_drive_that_cannot_share_is_named_and_nothing_is_grouped() {
        let mut network = overloaded();
        network.buses[0].members[2].abilities.no_group = vec![NoGroup::Dummy];
        let [obstacle] = &obstacles(&network)[..] else { panic!("one drive cannot") };
        assert_eq!(obstacle.reason, NoGroup::Dummy);
        assert_eq!(changed(&network, &[Change::Grouped]), None);
    }

    #[test]
    fn two_buses_keep_every_node() {
        let two = changed(&overloaded(), &[Change::SecondBus]).unwrap();
        let sizes: Vec<_> = two.buses.iter().map(|bus| bus.members.len()).collect();
        assert_eq!(sizes, [3, 4], "the switch box goes with the wrist");
        let nodes = |network| plans(network).iter().map(|plan| plan.node).collect::<Vec<_>>();
        assert_eq!(nodes(&two), nodes(&overloaded()));
    }

    #[test]
    fn only_a_bus_that_carries_too_much_is_split() {
        let mut network = overloaded();
        let quiet =
            Bus { members: network.buses[0].members.split_off(5), ..network.buses[0].clone() };
        network.buses.push(quiet);
        let sizes = |network: &Network| {
            network.buses.iter().map(|bus| bus.members.len()).collect::<Vec<_>>()
        };
        assert_eq!(sizes(&network), [5, 2]);
        assert_eq!(sizes(&changed(&network, &[Change::SecondBus]).unwrap()), [3, 2, 2]);
    }

    #[test]
    fn a_pair_of_pdos_a_drive_is_where_one_came_from() {
        let there = changed(&overloaded(), &[Change::Grouped]).unwrap();
        assert_eq!(changed(&there, &[Change::PerDrive]), Some(overloaded()));
        assert_eq!(changed(&overloaded(), &[Change::PerDrive]), None, "nothing to change");
    }

    #[test]
    fn every_slot_of_a_group_is_one_drives_and_a_dummy_for_the_others() {
        let grouped = changed(&overloaded(), &[Change::Grouped]).unwrap();
        for (place, plan) in plans(&grouped).into_iter().take(6).enumerate() {
            let rpdo = plan.pdos.iter().find(|pdo| pdo.direction == Direction::Receive).unwrap();
            assert_eq!(rpdo.cob_id, if place < 3 { 0x201 } else { 0x204 });
            let service = rpdo.service.as_ref().unwrap();
            let own = service.mapping.iter().map(|slot| slot.object == Object::TARGET_TORQUE);
            let expected = (0..3).map(|slot| slot == place % 3);
            assert!(own.eq(expected));
            assert_eq!((service.bytes(), service.event_timer_ms), (6, Some(5)));
        }
    }

    #[test]
    fn a_drive_without_an_rpdo_timer_keeps_its_quick_heartbeat() {
        let mut network = overloaded();
        let pdos = &mut network.buses[0].members[0].plan.pdos;
        pdos.iter_mut().filter_map(|pdo| pdo.service.as_mut()).for_each(|service| {
            service.event_timer_ms = None;
        });
        let slow = changed(&network, &[Change::SlowHeartbeats]).unwrap();
        let periods: Vec<_> =
            plans(&slow).iter().map(|plan| plan.error_control.period_ms()).collect();
        assert_eq!(periods, [25, 100, 100, 100, 100, 100, 100]);
        assert_eq!(plans(&slow)[1].error_control.lost_after().as_millis(), 240);
    }

    #[test]
    fn emergencies_move_where_they_may() {
        let mut network = overloaded();
        network.buses[0].members[0].abilities.moves_emergencies = false;
        let moved = changed(&network, &[Change::EmergenciesMoved]).unwrap();
        let ids: Vec<_> = plans(&moved).iter().map(|plan| plan.emcy_cob_id).collect();
        assert_eq!(ids, [0x81, 0x682, 0x683, 0x684, 0x685, 0x686, 0x690]);
    }
}
