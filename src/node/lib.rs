//! The node: CANopen master, cycle and safety of one hand controller. It connects `canopen` and `controller`.
//!
//! Call [`Node::bring_up`], then [`Node::cycle`] once per period, then [`Node::shut_down`]. Only the [`Bus`] waits.
//!
//! | to read about | begin at |
//! |---|---|
//! | one cycle | `cycle.rs`, in the order of docs/loop.md |
//! | frames and events that are received, emergencies among them | `receive.rs`: `on_frame`, `on_event` |
//! | causes of a stop, and what each leads to | `cause.rs`, `safety/table.rs` |
//! | the mode | `safety/mod.rs`: `advance`, `raise` |
//! | the boot and its checks, the proof test | `bring_up.rs`, `proof_test/mod.rs` |
//! | the orderly stop, power off | `shut_down.rs`, `power_off` |
//! | what a cycle leaves behind | `record.rs` |
//!
//! Each field of [`Node`] is a part in a file of its own; what needs several parts is a method of `Node`.
//!
//! ```
//! use node::cause::Cause;
//! use node::reaction::Reaction;
//! use units::numbering::Joint;
//!
//! // One row of the fault table has the message of a cause and its reaction.
//! let lost = Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 };
//! assert_eq!(lost.to_string(), "joint 3: no sample for 3 cycles");
//! assert_eq!(lost.kind().row().armed, Reaction::ZeroTorque);
//! ```
#![forbid(unsafe_code)]

mod boot_failures;
mod bring_up;
pub mod cause;
mod control;
mod cycle;
pub mod cycle_times;
mod cycle_timing;
mod drives;
mod guard_requests;
pub mod homing;
pub mod joint_reading;
mod lateness;
mod mode_check;
mod network;
mod newest_remote_sample;
pub mod operator;
mod park;
pub mod permit;
mod plausibility;
mod power;
mod power_off;
pub mod proof_test;
pub mod push;
pub mod reaction;
mod receive;
pub mod record;
mod remote_side;
mod request;
mod rest;
pub mod safety;
mod sample_times;
mod samples;
mod schedule;
mod sdo_pacer;
mod send;
mod shut_down;
#[cfg(test)]
mod silent_bus;
mod target_limiter;
mod target_readings;
mod targets;
mod transmission;
pub mod trial;
mod unpowered;
mod wire;
pub mod zero;

pub use bring_up::BringUpError;
pub use mode_check::WrongMode;
pub use park::ParkError;
pub use request::{Request, RequestError, Unfit};
pub use rest::NotAtRest;
pub use shut_down::PowerOffError;

use crate::boot_failures::ExpectedDrives;
use crate::cause::Cause;
use crate::control::Control;
use crate::cycle_timing::CycleTiming;
use crate::drives::Drives;
use crate::homing::HomingProgress;
use crate::mode_check::ModeCheck;
use crate::network::Network;
use crate::operator::OperatorMonitors;
use crate::plausibility::Plausibility;
use crate::power_off::PowerOff;
use crate::proof_test::{ProofTest, ProofTestReport};
use crate::record::Mode;
use crate::remote_side::RemoteSide;
use crate::rest::RestPosture;
use crate::safety::{EnableTimes, Safety, SafetyTimes};
use crate::samples::Samples;
use crate::trial::Trials;
use crate::wire::Wire;
use crate::zero::Zeros;
use bus::Bus;
use canopen::exchange::Exchange;
use canopen::master::event::Event;
use config::Config;
use config::facts::Facts;
use remote::Remote;

/// The node of one hand controller, on its buses.
#[derive(Clone, Debug)]
pub struct Node<B, R> {
    wire: Wire<B>,
    timing: CycleTiming,
    network: Network,
    expected_drives: ExpectedDrives,
    mode_check: ModeCheck,
    proof_test: ProofTest,
    samples: Samples,
    drives: Drives,
    power_off: PowerOff,
    rest: RestPosture,
    zeros: Zeros,
    homing: HomingProgress,
    trials: Trials,
    /// Names of the joints, base first.
    joint_names: [String; 6],
    remote_side: RemoteSide<R>,
    control: Control,
    operator: OperatorMonitors,
    plausibility: Plausibility,
    safety: Safety,
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Returns a node in `Boot`. Sends no frame.
    pub fn new(config: &Config, bus: B, remote: R) -> Self {
        let now = bus.now();
        let times = SafetyTimes {
            enable: EnableTimes {
                enable: config.safety.enable_timeout,
                initialise: config.joints.each_ref().map(|joint| joint.boot.timeouts.boot),
            },
            gravity: config.safety.gravity_ramp,
            reflection: config.safety.reflection_ramp,
        };
        let Exchange { tpdos, rpdos } = config.exchange().clone();
        let plans = config.node_plans();
        let switches = config.switches.as_ref();
        Self {
            timing: CycleTiming::new(config, now, bus.suspended()),
            wire: Wire::new(config, bus),
            expected_drives: ExpectedDrives::new(plans.iter().map(|(_, plan)| plan)),
            mode_check: ModeCheck::new(plans.iter().map(|(_, plan)| plan)),
            proof_test: ProofTest::new(config, &plans),
            network: Network::new(config, plans),
            samples: Samples::new(
                tpdos,
                plausibility::sample_filters(config),
                config.joints.each_ref().map(|joint| joint.channel),
                config.safety.missing_samples,
            ),
            power_off: PowerOff::new(
                config.exchange(),
                config.period,
                config.safety.missing_samples,
            ),
            rest: RestPosture::new(config),
            zeros: Zeros::new(config),
            homing: HomingProgress::default(),
            trials: Trials::new(config),
            joint_names: config.joints.each_ref().map(|joint| joint.name.clone()),
            drives: Drives::new(config, rpdos),
            remote_side: RemoteSide::new(config, now, remote),
            control: Control::new(config),
            operator: OperatorMonitors::new(config.period, switches.map(|them| them.buttons))
                .with_gripper(switches.and_then(|them| them.gripper)),
            plausibility: Plausibility::new(config),
            safety: Safety::new(times),
        }
    }

    /// Returns the mode to which the newest cause, request or cycle has led.
    pub const fn mode(&self) -> Mode {
        self.safety.mode()
    }

    /// Returns the first cause of the latched stop.
    pub const fn cause(&self) -> Option<Cause> {
        self.safety.cause()
    }

    /// Returns the text of a cause, with the name of its joint.
    pub fn in_words(&self, cause: Cause) -> String {
        self.with_names(&cause)
    }

    /// Returns the text of an error of this node with the names of its joints.
    pub fn with_names(&self, error: &impl ToString) -> String {
        cause::with_name(&error.to_string(), &self.joint_names)
    }

    /// Returns the results of the proof test; empty before a test, or if none is configured.
    pub const fn proof_test_report(&self) -> &ProofTestReport {
        self.proof_test.report()
    }

    /// Returns the facts of the drives, verified or stated only, in the order of the joints: as the last boot found them.
    pub fn facts(&self) -> &[Facts] {
        self.proof_test.facts()
    }

    /// Takes the oldest network event that was not taken yet, for the log.
    pub fn next_event(&mut self) -> Option<Event> {
        self.network.next_event()
    }

    /// Returns the bus, for its statistics.
    pub const fn bus(&self) -> &B {
        &self.wire.bus
    }

    /// Returns the bus, for simulated devices on it.
    pub const fn bus_mut(&mut self) -> &mut B {
        &mut self.wire.bus
    }

    /// Returns the commanded side.
    pub const fn remote(&self) -> &R {
        &self.remote_side.remote
    }

    /// Returns the commanded side, for a simulation behind it.
    pub const fn remote_mut(&mut self) -> &mut R {
        &mut self.remote_side.remote
    }
}
