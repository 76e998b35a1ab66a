//! Input of the bus planner: every configured node with its plan and the abilities of its EDS.

use crate::buses::BusSettings;
use crate::parameters::Parameters;
use canopen::frame::Channel;
use canopen::load::abilities::Abilities;
use canopen::load::network::{Bus, Member, Network};
use canopen::plan::NodePlan;

impl Parameters {
    /// Returns all buses with their nodes, as input of the bus planner.
    pub fn network(&self) -> Network {
        let buses = (0..).map(Channel).zip(&self.buses);
        let bus = |(channel, bus): (Channel, &BusSettings)| Bus {
            name: bus.name.clone(),
            bitrate: bus.bitrate,
            load_limit_percent: bus.load_limit_percent,
            members: members(self, channel),
        };
        Network {
            period_us: self.period_us(),
            master: self.node_id,
            master_heartbeat_ms: self.heartbeat_ms(),
            buses: buses.map(bus).collect(),
        }
    }
}

/// Returns the nodes on one bus.
fn members(config: &Parameters, channel: Channel) -> Vec<Member> {
    let here = config.node_plans().into_iter().filter(|(place, _)| *place == channel);
    let member = |plan: NodePlan| {
        let eds = config.eds_of(channel, plan.node)?;
        Some(Member { abilities: Abilities::from_eds(eds, plan.node), plan })
    };
    here.filter_map(|(_, plan)| member(plan)).collect()
}
