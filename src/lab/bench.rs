//! The whole loop in one process: a node on the in-memory bus, with everything it needs attached.

use std::collections::VecDeque;
use std::time::Duration;

use crate::world;
use bus::Bus;
use bus::Memory;
use bus::Tap;
use canopen::master::event::Event;
use config::Config;
use controller::switches::Mode as CommandMode;
use node::BringUpError;
use node::Node;
use node::NotConfirmed;
use node::Refused;
use node::Request;
use node::record::Mode;
use node::record::Record;
use remote::site::Link;
use remote::site::VirtualSite;
use sim::scenario::ConsoleRequest;
use sim::scenario::Scenario;
use sim::scenario::fault;
use sim::world::World;
use units::time::Instant;

/// What a bus carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Frames that were complete.
    pub frames: u64,
    /// Their bits, of all there could have been, in percent.
    pub percent: f64,
}

/// A node, its drives, its operator and its object.
#[derive(Clone, Debug)]
pub struct Bench<T> {
    node: Node<Memory<World, T>, VirtualSite>,
    /// What the scenario asks of the console, and when, in s after the first SYNC.
    requests: VecDeque<(f64, Request)>,
    bitrates: Vec<u32>,
    begun: Option<Instant>,
}

impl<T: Tap> Bench<T> {
    /// Everything `config` says, with an operator who follows `scenario` with the tremor of `seed`.
    /// `tap` is shown every frame. `in_real_time` lets no time pass faster than on the wall.
    pub fn new(config: &Config, scenario: Scenario, seed: u64, in_real_time: bool, tap: T) -> Self {
        Self::in_world_of(config, config, scenario, seed, in_real_time, tap)
    }

    /// As [`new`](Self::new), but drives, switch box and arm are those of `world`: what `config` makes
    /// the node believe of them may be wrong.
    pub fn in_world_of(
        world: &Config,
        config: &Config,
        scenario: Scenario,
        seed: u64,
        in_real_time: bool,
        tap: T,
    ) -> Self {
        let requests = scenario.requests().map(|(at, asked)| (at, request(asked)));
        let requests = requests.collect();
        let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
        let bus = Memory::new(&bitrates, world::build(world, scenario, seed), tap);
        let bus = if in_real_time { bus.in_real_time() } else { bus };
        let node = Node::new(config, bus, VirtualSite::new(&config.remote, config.period));
        Self { node, requests, bitrates, begun: None }
    }

    /// Boots the network and enables the drives.
    ///
    /// # Errors
    /// As [`Node::bring_up`].
    pub fn bring_up(&mut self) -> Result<(), BringUpError> {
        self.node.bring_up(&mut || false)
    }

    /// The same, given up when it takes longer than `limit` of virtual time.
    ///
    /// # Errors
    /// As [`Node::bring_up`].
    pub fn bring_up_within(&mut self, limit: Duration) -> Result<(), BringUpError> {
        let end = self.now() + limit;
        let watch = self.node.bus_mut().watch();
        let booted = self.node.bring_up(&mut || watch.now() >= end);
        self.node.bus_mut().unwatch();
        booted
    }

    /// The script goes on otherwise from now on: what it says of the past is past. `seed` is of its
    /// faults' chances.
    pub fn follow(&mut self, scenario: Scenario, seed: u64) {
        let now = self.node.bus().now();
        let elapsed = now.since(*self.begun.get_or_insert(now)).as_secs_f64();
        let requests = scenario.requests().filter(|(at, _)| *at > elapsed);
        self.requests = requests.map(|(at, asked)| (at, request(asked))).collect();
        self.world_mut().set_scenario(scenario, seed);
    }

    /// What the scenario asks of the console by now, the oldest that was not asked yet.
    pub fn due(&mut self) -> Option<Request> {
        let now = self.node.bus().now();
        let elapsed = now.since(*self.begun.get_or_insert(now)).as_secs_f64();
        let (_, request) = *self.requests.front().filter(|(at, _)| *at <= elapsed)?;
        self.requests.pop_front();
        Some(request)
    }

    /// Does what the scenario asks of the console by now, then one cycle.
    pub fn cycle(&mut self) -> Record {
        while let Some(request) = self.due() {
            if let Err(refused) = self.ask(request) {
                tracing::warn!(?request, %refused, "console");
            }
        }
        let link = match self.node.bus().stations().link() {
            fault::Link::Up => Link::Up,
            fault::Link::Frozen => Link::Frozen,
            fault::Link::Lost => Link::Lost,
        };
        self.node.remote_mut().set_link(link);
        self.node.cycle()
    }

    /// Runs so many cycles.
    pub fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Asks the node something between two cycles.
    ///
    /// # Errors
    /// As [`Node::request`].
    pub fn ask(&mut self, request: Request) -> Result<Mode, Refused> {
        self.node.request(request, &mut || false)
    }

    /// The node stands still, as if it had been killed; what is attached lives on. When that began.
    pub fn fall_silent_for(&mut self, span: Duration) -> Instant {
        let bus = self.node.bus_mut();
        let begun = bus.now();
        while bus.receive(begun + span).is_some() {}
        begun
    }

    /// Torque off, drives off, confirmed.
    ///
    /// # Errors
    /// As [`Node::stop`].
    pub fn stop(&mut self) -> Result<(), NotConfirmed> {
        self.node.stop()
    }

    /// The node.
    pub const fn node(&self) -> &Node<Memory<World, T>, VirtualSite> {
        &self.node
    }

    /// Who is shown every frame, to tell it something.
    pub const fn tap_mut(&mut self) -> &mut T {
        self.node.bus_mut().tap_mut()
    }

    /// The commanded side, to break it.
    pub const fn site_mut(&mut self) -> &mut VirtualSite {
        self.node.remote_mut()
    }

    /// The buses, to disturb them.
    pub const fn bus_mut(&mut self) -> &mut Memory<World, T> {
        self.node.bus_mut()
    }

    /// What has happened on the network, for people: the oldest that was not asked for yet.
    pub fn notice(&mut self) -> Option<Event> {
        self.node.notice()
    }

    /// The time on the bus.
    pub fn now(&self) -> Instant {
        self.node.bus().now()
    }

    /// When the script began: at the first SYNC.
    pub fn begun(&self) -> Instant {
        self.node.bus().stations().scenario_start().unwrap_or(Instant::ZERO)
    }

    /// How long the script has run.
    pub fn elapsed(&self) -> Duration {
        let bus = self.node.bus();
        let now = bus.now();
        now.since(bus.stations().scenario_start().unwrap_or(now))
    }

    /// What is attached, to break it.
    pub const fn world_mut(&mut self) -> &mut World {
        self.node.bus_mut().stations_mut()
    }

    /// What each bus has carried so far.
    pub fn carried(&self) -> Vec<Carried> {
        let bus = self.node.bus();
        let seconds = bus.now().since(Instant::ZERO).as_secs_f64();
        let of = |((frames, bits), bitrate): ((u64, u64), &u32)| {
            let seconds_on_wire =
                Duration::from_micros(bits).as_secs_f64() * 1e6 / f64::from(*bitrate);
            Carried { frames, percent: 100.0 * seconds_on_wire / seconds.max(1e-6) }
        };
        bus.carried().zip(&self.bitrates).map(of).collect()
    }
}

fn request(asked: ConsoleRequest) -> Request {
    match asked {
        ConsoleRequest::Arm => Request::Arm,
        ConsoleRequest::Disarm => Request::Disarm,
        ConsoleRequest::Reset => Request::Reset,
        ConsoleRequest::Rate => Request::Command(CommandMode::Rate),
        ConsoleRequest::Pose => Request::Command(CommandMode::Pose),
    }
}
