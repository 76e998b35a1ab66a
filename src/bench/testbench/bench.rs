//! Node on the in-memory bus with simulated drives, operator and object: the closed loop in one process.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Vector3;

use crate::delayed::DelayedSide;
use crate::disturbed::{FaultySide, LinkState};
use crate::side::Side;
use crate::world;
use bus::{Bus, Tap};
use canopen::master::event::Event;
use config::Config;
use controller::switches::CommandMode;
use faults::{Fault, FaultKind, LinkFault};
use inputs::{InputSink, RecordedNode};
use memory_bus::Memory;
use node::record::{Mode, Record};
use node::{BringUpError, PowerOffError, Request, RequestError};
use sim::fault::Notice;
use sim::scenario::{ConsoleRequest, Scenario};
use sim::world::World;
use units::spatial::Wrench;
use units::time::Instant;

/// Frames and load of one bus since the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusTraffic {
    /// Number of complete frames.
    pub frames: u64,
    /// Bus load, in percent.
    pub percent: f64,
}

/// Node of a bench, whose inputs go to `S`.
pub type BenchNode<T, S> = RecordedNode<Memory<World, T>, FaultySide<DelayedSide<Side>>, S>;

/// Node with its drives, its operator and its object.
#[derive(Clone, Debug)]
pub struct Bench<T, S = ()> {
    node: BenchNode<T, S>,
    /// Requests of the scenario to the console, and their times in s after the first SYNC.
    requests: VecDeque<(f64, Request)>,
    bitrates: Vec<u32>,
    begun: Option<Instant>,
    host_faults: HostFaults,
}

/// Faults of buses, host and commanded side, which the simulated world does not apply.
#[derive(Clone, Debug, Default)]
struct HostFaults {
    /// Faults that were not planned on the bus yet.
    to_plan: Vec<Fault>,
    forces: Vec<Fault>,
    /// Starts and ends that were not reported, in order.
    notices: VecDeque<Notice>,
}

impl HostFaults {
    /// Creates the faults of a scenario that start after `elapsed`.
    fn after(scenario: &Scenario, elapsed: Duration) -> Self {
        let faults = scenario.faults().iter().copied();
        let to_plan: Vec<Fault> =
            faults.filter(|fault| fault.is_of_host() && fault.start >= elapsed).collect();
        let is_force = |fault: &&Fault| matches!(fault.kind, FaultKind::SensedForce(_));
        let forces = to_plan.iter().filter(is_force).copied().collect();
        let mut notices: Vec<Notice> = to_plan.iter().flat_map(notices).collect();
        notices.sort_by_key(|notice| notice.at);
        Self { to_plan, forces, notices: notices.into() }
    }

    /// Returns the force that the commanded side reports, in N.
    fn force(&self, elapsed: Duration) -> Option<f64> {
        let runs = |fault: &&Fault| {
            let end = fault.duration.map_or(Duration::MAX, |span| fault.start + span);
            (fault.start..end).contains(&elapsed)
        };
        let FaultKind::SensedForce(force) = self.forces.iter().rfind(runs)?.kind else {
            return None;
        };
        Some(force)
    }
}

/// Returns start and end of a fault.
fn notices(fault: &Fault) -> impl Iterator<Item = Notice> + use<> {
    let fault = *fault;
    let end = fault.duration.map(|duration| fault.start + duration);
    let end = end.map(|at| Notice { at, fault, is_over: true });
    [Notice { at: fault.start, fault, is_over: false }].into_iter().chain(end)
}

/// Script of a bench.
#[derive(Clone, Debug)]
pub struct Course {
    /// Operator, faults and requests.
    pub scenario: Scenario,
    /// Seed of the operator's tremor.
    pub seed: u64,
    /// Maximum seconds of virtual time per second of the wall clock; `None` for as fast as possible.
    pub speed: Option<f64>,
}

impl<T: Tap> Bench<T> {
    /// Creates a bench of `config`, whose operator follows `scenario` with the tremor of `seed`. `tap` receives every frame.
    pub fn new(config: &Config, scenario: Scenario, seed: u64, tap: T) -> Self {
        Self::in_world_of(config, config, scenario, seed, tap)
    }

    /// Creates a bench as [`new`](Self::new), with another commanded side than that of `config`.
    pub fn with_side(config: &Config, side: Side, scenario: Scenario, seed: u64, tap: T) -> Self {
        Self::recorded(config, side, Course { scenario, seed, speed: None }, tap, ())
    }

    /// Creates a bench as [`new`](Self::new), with drives, switch box and arm of another configuration than the node's.
    pub fn in_world_of(
        world: &Config,
        config: &Config,
        scenario: Scenario,
        seed: u64,
        tap: T,
    ) -> Self {
        let course = Course { scenario, seed, speed: None };
        Self::of_parts(world, config, Side::from_config(config), course, tap, ())
    }
}

impl<T: Tap, S: InputSink + Clone> Bench<T, S> {
    /// Creates a bench of `config` with this commanded side. `tap` receives every frame, and `sink` the inputs of the node.
    pub fn recorded(config: &Config, side: Side, course: Course, tap: T, sink: S) -> Self {
        Self::of_parts(config, config, side, course, tap, sink)
    }

    fn of_parts(
        world: &Config,
        config: &Config,
        side: Side,
        course: Course,
        tap: T,
        sink: S,
    ) -> Self {
        let Course { scenario, seed, speed } = course;
        let requests = scenario.requests().map(|(at, asked)| (at, request(asked)));
        let requests = requests.collect();
        let host_faults = HostFaults::after(&scenario, Duration::ZERO);
        let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
        let bus = Memory::new(&bitrates, world::build(world, scenario, seed), tap);
        let bus = match speed {
            Some(speed) => bus.at_speed(speed),
            None => bus,
        };
        let side = FaultySide::new(DelayedSide::by(side, config.link.simulated));
        let node = RecordedNode::new(config, bus, side, sink);
        Self { node, requests, bitrates, begun: None, host_faults }
    }

    /// Boots the network and enables the drives.
    ///
    /// # Errors
    /// As [`RecordedNode::bring_up`].
    pub fn bring_up(&mut self) -> Result<(), BringUpError> {
        self.node.bring_up(&mut || false)
    }

    /// Boots the network, and gives up after `limit` of virtual time.
    ///
    /// # Errors
    /// As [`RecordedNode::bring_up`].
    pub fn bring_up_within(&mut self, limit: Duration) -> Result<(), BringUpError> {
        self.within(limit, |node, give_up| node.bring_up(give_up))
    }

    /// Makes a request to the node, and gives up its boot or homing after `limit` of virtual time, as Ctrl-C does.
    ///
    /// # Errors
    /// As [`RecordedNode::request`].
    pub fn ask_within(&mut self, request: Request, limit: Duration) -> Result<Mode, RequestError> {
        self.within(limit, |node, give_up| node.request(request, give_up))
    }

    fn within<R>(
        &mut self,
        limit: Duration,
        act: impl FnOnce(&mut BenchNode<T, S>, &mut dyn FnMut() -> bool) -> R,
    ) -> R {
        let end = self.now() + limit;
        let time = self.node.bus_mut().share_time();
        let result = act(&mut self.node, &mut || time.now() >= end);
        self.node.bus_mut().stop_sharing_time();
        result
    }

    /// Continues with another scenario; its entries of the past are skipped. `seed` is that of its faults.
    pub fn follow(&mut self, scenario: Scenario, seed: u64) {
        let now = self.node.bus().now();
        let elapsed = now.since(*self.begun.get_or_insert(now)).as_secs_f64();
        let requests = scenario.requests().filter(|(at, _)| *at > elapsed);
        self.requests = requests.map(|(at, asked)| (at, request(asked))).collect();
        self.host_faults = HostFaults::after(&scenario, self.elapsed());
        self.world_mut().set_scenario(scenario, seed);
        self.plan_host_faults();
    }

    /// Takes the oldest request of the scenario whose time has come.
    pub fn due(&mut self) -> Option<Request> {
        let now = self.node.bus().now();
        let elapsed = now.since(*self.begun.get_or_insert(now)).as_secs_f64();
        let (_, request) = *self.requests.front().filter(|(at, _)| *at <= elapsed)?;
        self.requests.pop_front();
        Some(request)
    }

    /// Makes the requests of the scenario whose time has come, then runs one cycle.
    pub fn cycle(&mut self) -> Record {
        while let Some(request) = self.due() {
            if let Err(refused) = self.ask(request) {
                tracing::warn!(?request, %refused, "console");
            }
        }
        self.plan_host_faults();
        let link = match self.node.bus().stations().link() {
            None => LinkState::Up,
            Some(LinkFault::Frozen) => LinkState::Frozen,
            Some(LinkFault::Lost) => LinkState::Lost,
            Some(LinkFault::Slow) => LinkState::Slow,
            Some(LinkFault::Held) => LinkState::Held,
            Some(LinkFault::Foreign) => LinkState::Foreign,
        };
        self.node.remote_mut().set_link(link);
        if !self.host_faults.forces.is_empty() {
            let force = self.host_faults.force(self.elapsed());
            let along_x =
                |force| Wrench { force: Vector3::new(force, 0.0, 0.0), moment: Vector3::zeros() };
            self.node.remote_mut().set_sensor_fault(force.map(along_x));
        }
        self.node.cycle()
    }

    /// Plans the faults of buses and host, once the first SYNC has set their time zero.
    fn plan_host_faults(&mut self) {
        let Some(zero) = self.node.bus().stations().scenario_start() else { return };
        for fault in std::mem::take(&mut self.host_faults.to_plan) {
            self.node.bus_mut().inject(zero, &fault);
        }
    }

    /// Takes the oldest start or end of a fault that was not reported yet.
    pub fn fault_notice(&mut self) -> Option<Notice> {
        let elapsed = self.elapsed();
        let notices = &mut self.host_faults.notices;
        let is_due = notices.front().is_some_and(|notice| notice.at <= elapsed);
        let of_host = if is_due { notices.pop_front() } else { None };
        of_host.or_else(|| self.world_mut().next_notice())
    }

    /// Runs this many cycles.
    pub fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Makes a request to the node between two cycles.
    ///
    /// # Errors
    /// As [`RecordedNode::request`].
    pub fn ask(&mut self, request: Request) -> Result<Mode, RequestError> {
        self.node.request(request, &mut || false)
    }

    /// Stops the node's process as by a kill while the stations continue. Returns the time of the stop.
    pub fn fall_silent_for(&mut self, span: Duration) -> Instant {
        let bus = self.node.bus_mut();
        let begun = bus.now();
        while bus.receive(begun + span).is_some() {}
        begun
    }

    /// Stops the node in order: torque off, drives off, confirmed.
    ///
    /// # Errors
    /// As [`RecordedNode::shut_down`].
    pub fn shut_down(&mut self) -> Result<(), PowerOffError> {
        self.node.shut_down(&mut || false)
    }

    /// Returns the node under test, whose inputs are recorded.
    pub const fn node(&self) -> &BenchNode<T, S> {
        &self.node
    }

    /// Returns the tap that receives every frame.
    pub const fn tap_mut(&mut self) -> &mut T {
        self.node.bus_mut().tap_mut()
    }

    /// Sets the wrench reported by a broken sensor of the commanded side; `None` repairs it.
    pub const fn set_sensor_fault(&mut self, reported: Option<Wrench>) {
        self.node.remote_mut().set_sensor_fault(reported);
    }

    /// Returns the commanded side.
    pub const fn side(&self) -> &Side {
        self.node.remote().side().far()
    }

    /// Returns the buses in memory with their stations, to disturb them between cycles.
    pub const fn bus_mut(&mut self) -> &mut Memory<World, T> {
        self.node.bus_mut()
    }

    /// Takes the oldest event of the network.
    pub fn next_event(&mut self) -> Option<Event> {
        self.node.next_event()
    }

    /// Returns the time on the bus.
    pub fn now(&self) -> Instant {
        self.node.bus().now()
    }

    /// Returns time zero of the scenario: the first SYNC.
    pub fn begun(&self) -> Instant {
        self.node.bus().stations().scenario_start().unwrap_or(Instant::ZERO)
    }

    /// Returns the time since the start of the scenario.
    pub fn elapsed(&self) -> Duration {
        let bus = self.node.bus();
        let now = bus.now();
        now.since(bus.stations().scenario_start().unwrap_or(now))
    }

    /// Returns the simulated stations, with their ground truth.
    pub const fn world(&self) -> &World {
        self.node.bus().stations()
    }

    /// Returns the simulated stations for changes.
    pub const fn world_mut(&mut self) -> &mut World {
        self.node.bus_mut().stations_mut()
    }

    /// Returns the traffic of each bus so far.
    pub fn carried(&self) -> Vec<BusTraffic> {
        let bus = self.node.bus();
        let seconds = bus.now().since(Instant::ZERO).as_secs_f64();
        let of = |((frames, bits), bitrate): ((u64, u64), &u32)| {
            let seconds_on_wire =
                Duration::from_micros(bits).as_secs_f64() * 1e6 / f64::from(*bitrate);
            BusTraffic { frames, percent: 100.0 * seconds_on_wire / seconds.max(1e-6) }
        };
        bus.carried().zip(&self.bitrates).map(of).collect()
    }
}

fn request(asked: ConsoleRequest) -> Request {
    match asked {
        ConsoleRequest::Arm => Request::Arm,
        ConsoleRequest::Disarm => Request::Disarm,
        ConsoleRequest::Reset => Request::Reset,
        ConsoleRequest::Zero => Request::Zero(None),
        ConsoleRequest::Park => Request::Park,
        ConsoleRequest::Rate => Request::Command(CommandMode::Rate),
        ConsoleRequest::Pose => Request::Command(CommandMode::Pose),
        ConsoleRequest::Adjust(adjustment) => Request::Adjust(adjustment),
    }
}
