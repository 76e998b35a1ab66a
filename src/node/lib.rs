//! The node: bring-up, one cycle, one mode, stop. Where canopen and controller meet.
//!
//! Its owner calls [`Node::bring_up`], then [`Node::cycle`] for as long as it runs, then
//! [`Node::stop`]. All waiting happens in the [`Bus`].
//!
//! ```
//! use node::cause::Cause;
//! use node::safety::table::{Reaction, row};
//!
//! // What a cause leads to stands in one table.
//! let lost = Cause::SamplesMissing { joint: 3, cycles: 3 };
//! assert_eq!(lost.to_string(), "joint 3: no sample for 3 cycles");
//! assert_eq!(row(lost.kind()).armed, Reaction::ZeroTorque);
//! ```
#![forbid(unsafe_code)]

mod asking;
mod bring_up;
pub mod cause;
mod cycle;
mod gate;
mod link;
pub mod operator;
mod plausibility;
mod power;
pub mod proof;
pub mod record;
mod request;
pub mod safety;
mod samples;
mod schedule;
#[cfg(test)]
mod silent;
mod targets;
mod timing;
mod transmission;
mod unpowered;

pub use bring_up::BringUpError;
pub use bring_up::NotConfirmed;
pub use request::Refused;
pub use request::Request;

use std::collections::VecDeque;
use std::time::Duration;

use crate::asking::Asking;
use crate::cause::Cause;
use crate::gate::Gate;
use crate::link::Link;
use crate::operator::Operator;
use crate::plausibility::Plausibility;
use crate::power::PowerStages;
use crate::proof::Proof;
use crate::proof::ProofReport;
use crate::record::Mode;
use crate::record::Others;
use crate::safety::Ramps;
use crate::safety::Safety;
use crate::samples::Samples;
use crate::schedule::Schedule;
use crate::timing::Timing;
use crate::transmission::Transmission;
use bus::Bus;
use canopen::NmtState;
use canopen::exchange::Outbox;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::heartbeat::Producer;
use canopen::master::Master;
use canopen::master::event::Event;
use canopen::sync::Counter;
use canopen::time_stamp;
use config::Config;
use controller::Controller;
use controller::switches::Mode as CommandMode;
use remote::Remote;
use units::spatial::Motion;

/// One hand controller's node on its buses.
#[derive(Clone, Debug)]
pub struct Node<B, R> {
    bus: B,
    remote: R,
    period: Duration,
    /// How long after a SYNC samples are waited for.
    window: Duration,
    /// How long after one sample the next one may come.
    next_answer: Duration,
    channels: Vec<Channel>,
    /// What the drives are told, in the frames of the layout.
    outbox: Outbox,
    master: Master,
    heartbeat: Producer,
    sync: Counter,
    /// TIME, if it is told.
    clock: Option<time_stamp::Producer>,
    controller: Controller,
    command_mode: CommandMode,
    safety: Safety,
    operator: Operator,
    gate: Gate,
    samples: Samples,
    plausibility: Plausibility,
    power: PowerStages,
    proof: Proof,
    schedule: Schedule,
    timing: Timing,
    transmission: Transmission,
    asking: Asking,
    /// Frames read at most after a wait should have ended.
    most_late: u64,
    cycle: u64,
    link: Link,
    /// Frames on their way out.
    out: Vec<Telegram>,
    /// What has happened on the network and was not asked for yet.
    notices: VecDeque<Event>,
}

/// Notices that may wait to be asked for; more are lost.
const NOTICES: usize = 64;

impl<B: Bus, R: Remote> Node<B, R> {
    /// A node that has sent nothing yet.
    pub fn new(config: &Config, bus: B, mut remote: R) -> Self {
        let now = bus.now();
        let ramps = Ramps {
            gravity: config.safety.gravity_ramp,
            reflection: config.safety.reflection_ramp,
        };
        let mut link = Link::new(config.link_period());
        link.take(now, remote.exchange(now, &Motion::Hold));
        let (inbox, outbox) = config.exchange();
        let plans = config.node_plans();
        let proof = Proof::new(config, &plans);
        Self {
            period: config.period,
            window: config.window(),
            next_answer: config.longest_frame(),
            channels: config.channels(),
            outbox,
            master: Master::new(plans),
            sync: Counter::new(config.sync_counter),
            clock: config
                .time_period
                .map(|period| time_stamp::Producer::new(time_stamp::COB_ID, period)),
            heartbeat: Producer::new(config.node_id, config.heartbeat, NmtState::Operational),
            controller: Controller::new(&config.controller),
            command_mode: config.command_mode,
            safety: Safety::new(ramps),
            operator: Operator::new(config.period),
            gate: Gate::new(config.joints.each_ref().map(|joint| joint.calibration.max_target())),
            samples: Samples::new(
                inbox,
                plausibility::intakes(config),
                config.joints.each_ref().map(|joint| joint.channel),
                config.safety.missing_samples,
            ),
            plausibility: Plausibility::new(config),
            power: PowerStages::new(config.safety.missing_samples),
            proof,
            schedule: Schedule::starting(now, config.period),
            timing: Timing::new(config.period, bus.suspended()),
            transmission: Transmission::on(&config.channels()),
            asking: Asking::new(),
            most_late: config.most_frames(timing::OVERRUN + 1),
            cycle: 0,
            link,
            out: Vec::with_capacity(64),
            notices: VecDeque::with_capacity(NOTICES),
            bus,
            remote,
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
        self.notices.pop_front()
    }

    /// What was seen of other clients, and could not be read again.
    fn others(&self) -> Others {
        Others { uploads: self.master.foreign_uploads(), unread: self.proof.unread() }
    }

    fn note(&mut self, event: Event) {
        if self.notices.len() < NOTICES {
            self.notices.push_back(event);
        }
    }

    /// The bus, to ask it for its statistics.
    pub const fn bus(&self) -> &B {
        &self.bus
    }

    /// The bus, to reach what is attached to it.
    pub const fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// The commanded side.
    pub const fn remote(&self) -> &R {
        &self.remote
    }

    /// The commanded side, to reach what is behind it.
    pub const fn remote_mut(&mut self) -> &mut R {
        &mut self.remote
    }
}
