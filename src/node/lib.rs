//! The node: bring-up, one cycle, one mode, stop. Where canopen and controller meet.
//!
//! Its owner calls [`Node::bring_up`], then [`Node::cycle`] for as long as it runs, then
//! [`Node::stop`]. All waiting happens in the [`Bus`].
//!
//! ```
//! use node::cause::Cause;
//! use node::reaction::Reaction;
//! use units::numbering::Joint;
//!
//! // What a cause says and leads to stands in one row of one table.
//! let lost = Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 };
//! assert_eq!(lost.to_string(), "joint 3: no sample for 3 cycles");
//! assert_eq!(lost.kind().row().armed, Reaction::ZeroTorque);
//! ```
#![forbid(unsafe_code)]

mod bring_up;
pub mod cause;
mod control;
mod cycle;
mod cycle_timing;
mod drives;
mod gate;
mod lateness;
mod link;
mod network;
pub mod operator;
pub mod permit;
mod plausibility;
mod power;
pub mod proof;
pub mod reaction;
mod receive;
pub mod record;
mod remote_side;
mod request;
pub mod safety;
mod samples;
mod schedule;
mod sdo_pacer;
mod send;
#[cfg(test)]
mod silent;
mod targets;
mod transmission;
mod unpowered;
mod wire;

pub use bring_up::BringUpError;
pub use bring_up::NotConfirmed;
pub use request::Refused;
pub use request::Request;

use crate::cause::Cause;
use crate::control::Control;
use crate::cycle_timing::CycleTiming;
use crate::drives::Drives;
use crate::network::Network;
use crate::operator::Operator;
use crate::plausibility::Plausibility;
use crate::proof::Proof;
use crate::proof::ProofReport;
use crate::record::Mode;
use crate::remote_side::RemoteSide;
use crate::safety::Ramps;
use crate::safety::Safety;
use crate::samples::Samples;
use crate::wire::Wire;
use bus::Bus;
use canopen::exchange::Exchange;
use canopen::master::event::Event;
use config::Config;
use remote::Remote;

/// One hand controller's node on its buses.
#[derive(Clone, Debug)]
pub struct Node<B, R> {
    wire: Wire<B>,
    timing: CycleTiming,
    network: Network,
    proof: Proof,
    samples: Samples,
    drives: Drives,
    remote: RemoteSide<R>,
    control: Control,
    operator: Operator,
    plausibility: Plausibility,
    safety: Safety,
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// A node that has sent nothing yet.
    pub fn new(config: &Config, bus: B, remote: R) -> Self {
        let now = bus.now();
        let ramps = Ramps {
            gravity: config.safety.gravity_ramp,
            reflection: config.safety.reflection_ramp,
        };
        let Exchange { inbox, outbox: rpdos } = config.exchange().clone();
        let plans = config.node_plans();
        Self {
            timing: CycleTiming::new(config, now, bus.suspended()),
            wire: Wire::new(config, bus),
            proof: Proof::new(config, &plans),
            network: Network::new(config, plans),
            samples: Samples::new(
                inbox,
                plausibility::intakes(config),
                config.joints.each_ref().map(|joint| joint.channel),
                config.safety.missing_samples,
            ),
            drives: Drives::new(config, rpdos),
            remote: RemoteSide::new(config, now, remote),
            control: Control::new(config),
            operator: Operator::new(config.period),
            plausibility: Plausibility::new(config),
            safety: Safety::new(ramps),
        }
    }

    /// The mode.
    pub const fn mode(&self) -> Mode {
        self.safety.mode()
    }

    /// What stopped the node, while it is stopped.
    pub const fn cause(&self) -> Option<Cause> {
        self.safety.cause()
    }

    /// What the drives have shown of stopping by themselves; empty where nothing was proven.
    pub const fn proof(&self) -> &ProofReport {
        self.proof.report()
    }

    /// What has happened on the network, for people: the oldest that was not asked for yet.
    pub fn notice(&mut self) -> Option<Event> {
        self.network.notice()
    }

    /// The bus, to ask it for its statistics.
    pub const fn bus(&self) -> &B {
        &self.wire.bus
    }

    /// The bus, to reach what is attached to it.
    pub const fn bus_mut(&mut self) -> &mut B {
        &mut self.wire.bus
    }

    /// The commanded side.
    pub const fn remote(&self) -> &R {
        &self.remote.remote
    }

    /// The commanded side, to reach what is behind it.
    pub const fn remote_mut(&mut self) -> &mut R {
        &mut self.remote.remote
    }
}
