//! Variants of a network: layouts and changes that [`proposals`](crate::load::proposals) compares.

use canopen_rs::NodeId;
use derive_more::Display;

use crate::emcy;
use crate::layout::{self, Direction, Group, Pdo};
use crate::load::lacks::Lack;
use crate::load::network::{Bus, Member, Network};
use crate::load::utilisation::BusLoad;
use crate::plan::{ErrorControl, NodePlan};

/// Heartbeat period of nodes that also monitor their RPDO, in ms.
const SLOW_HEARTBEAT_MS: u16 = 100;

/// Change of a network.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Change {
    /// One RPDO and one TPDO per drive, both cyclic synchronous.
    #[display("one RPDO and one TPDO a drive")]
    PerDrive,
    /// Three drives share one torque RPDO; states are sent on change.
    #[display("three torques in one RPDO")]
    Grouped,
    /// Statusword and controlword are sent on change, in separate PDOs.
    #[display("statusword and controlword on change")]
    StatesOnChange,
    /// Half of a bus's drives move to a second bus.
    #[display("a second bus for half of the drives")]
    SecondBus,
    /// Another SYNC period, in µs.
    #[display("{:.0} Hz", 1e6 / f64::from((*_0).max(1)))]
    Period(u32),
    /// Nodes with an RPDO timer, or without torque, send a heartbeat every 100 ms.
    #[display("the nodes' heartbeats every {SLOW_HEARTBEAT_MS} ms")]
    SlowHeartbeats,
    /// EMCY COB-IDs with a lower priority than all cyclic frames.
    #[display("emergencies behind the PDOs")]
    EmergenciesMoved,
}

/// Drive that cannot take a shared RPDO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Obstacle {
    /// Name of the drive.
    pub drive: String,
    /// Missing parts of the grouped layout, at least one.
    pub lacks: Vec<Lack>,
}

/// Applies `changes` to `network` in order; `None` if one is impossible or has no effect.
pub fn changed(network: &Network, changes: &[Change]) -> Option<Network> {
    changes.iter().try_fold(network.clone(), |network, change| {
        let done = match change {
            Change::PerDrive => Some(on_every_bus(&network, per_drive)),
            Change::Grouped => {
                obstacles(&network).is_empty().then(|| on_every_bus(&network, grouped))
            }
            Change::StatesOnChange => {
                can_split_states(&network).then(|| on_every_bus(&network, states_on_change))
            }
            Change::SecondBus => Some(split(&network)),
            Change::Period(period_us) => Some(Network { period_us: *period_us, ..network.clone() }),
            Change::SlowHeartbeats => Some(on_every_bus(&network, slow_heartbeats)),
            Change::EmergenciesMoved => Some(emergencies_moved(&network)),
        };
        done.filter(|done| *done != network)
    })
}

/// Drives that prevent a grouping of the torques.
pub fn obstacles(network: &Network) -> Vec<Obstacle> {
    let drives =
        network.buses.iter().flat_map(|bus| &bus.members).filter(|member| member.plan.is_drive());
    let unable = drives.filter(|member| !member.abilities.no_group.is_empty());
    let of = |member: &Member| Obstacle {
        drive: member.plan.name.clone(),
        lacks: member.abilities.no_group.clone(),
    };
    unable.map(of).collect()
}

fn can_split_states(network: &Network) -> bool {
    let members = network.buses.iter().flat_map(|bus| &bus.members);
    members.filter(|member| member.plan.is_drive()).all(|it| it.abilities.can_split_states())
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

/// Splits every overloaded bus, or every bus if none is: the first half of its drives stays, the rest moves.
fn split(network: &Network) -> Network {
    let loads = network.loads();
    let buses = network.buses.iter().zip(loads);
    let is_overloaded =
        |(bus, load): &(&Bus, BusLoad)| load.within(bus.load_limit_percent).is_err();
    let none_is = !buses.clone().any(|bus| is_overloaded(&bus));
    let parts =
        |bus| if none_is || is_overloaded(&bus) { halves(bus.0) } else { vec![bus.0.clone()] };
    Network { buses: buses.flat_map(parts).collect(), ..network.clone() }
}

/// Splits a bus in two, unless one part would be empty.
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

/// Slows the heartbeats of drives with an RPDO timer, which guards the torque. The number of tolerated losses
/// stays.
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

/// RPDO event timer of a drive, if it has one, in ms.
fn rpdo_timer_ms(plan: &NodePlan) -> Option<u16> {
    let mut rpdos = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive);
    rpdos.find_map(|pdo| pdo.service.as_ref()?.event_timer_ms)
}

/// Plans of one bus with a pair of PDOs per drive.
fn per_drive(plans: &[NodePlan]) -> Vec<NodePlan> {
    laid_out(plans, |_, node, _, timer| layout::per_drive(node, timer))
}

/// Plans of one bus with grouped torques.
fn grouped(plans: &[NodePlan]) -> Vec<NodePlan> {
    laid_out(plans, |place, node, group, timer| layout::grouped(node, place, group, timer))
}

/// Plans of one bus with groups of one drive.
fn states_on_change(plans: &[NodePlan]) -> Vec<NodePlan> {
    laid_out(plans, |place, node, _, timer| {
        let alone = Group { cob_id: layout::rpdo1(node), size: 1, slot: 0 };
        layout::grouped(node, place, alone, timer)
    })
}

/// Replaces the PDOs of every drive by those of `pdos`, from its index, node, group and RPDO timer. Other
/// disabled PDOs stay disabled.
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
    use crate::load::lacks;
    use crate::object::Object;
    use crate::testing::networks::{network, six_drives_and_switches};

    fn overloaded() -> Network {
        network(six_drives_and_switches(), 1_000)
    }

    fn plans(network: &Network) -> Vec<&NodePlan> {
        network.buses.iter().flat_map(|bus| &bus.members).map(|member| &member.plan).collect()
    }

    #[test]
    fn unable_drive_is_named_and_prevents_grouping() {
        let mut network = overloaded();
        network.buses[0].members[2].abilities.no_group = vec![Lack::Dummy(Object::DUMMY_INTEGER16)];
        let [obstacle] = &obstacles(&network)[..] else { panic!("one drive cannot") };
        assert_eq!(lacks::listed(&obstacle.lacks), "dummy mapping of 0003h");
        assert_eq!(changed(&network, &[Change::Grouped]), None);
    }

    #[test]
    fn second_bus_keeps_every_node() {
        let two = changed(&overloaded(), &[Change::SecondBus]).unwrap();
        let sizes: Vec<_> = two.buses.iter().map(|bus| bus.members.len()).collect();
        assert_eq!(sizes, [3, 4], "the switch box goes with the wrist");
        let nodes = |network| plans(network).iter().map(|plan| plan.node).collect::<Vec<_>>();
        assert_eq!(nodes(&two), nodes(&overloaded()));
    }

    #[test]
    fn only_an_overloaded_bus_is_split() {
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
    fn per_drive_layout_reverts_grouping() {
        let there = changed(&overloaded(), &[Change::Grouped]).unwrap();
        assert_eq!(changed(&there, &[Change::PerDrive]), Some(overloaded()));
        assert_eq!(changed(&overloaded(), &[Change::PerDrive]), None, "nothing to change");
    }

    #[test]
    fn group_slot_is_mapped_by_one_drive_and_a_dummy_else() {
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
    fn drive_without_rpdo_timer_keeps_its_heartbeat() {
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
    fn emergencies_move_where_permitted() {
        let mut network = overloaded();
        network.buses[0].members[0].abilities.moves_emergencies = false;
        let moved = changed(&network, &[Change::EmergenciesMoved]).unwrap();
        let ids: Vec<_> = plans(&moved).iter().map(|plan| plan.emcy_cob_id).collect();
        assert_eq!(ids, [0x81, 0x682, 0x683, 0x684, 0x685, 0x686, 0x690]);
    }
}
