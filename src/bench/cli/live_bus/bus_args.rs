//! Selection of the bus of a tool, and its part of the configuration.

use std::path::PathBuf;

use clap::Args;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::live_bus::{NodeArg, Session, SessionError};
use bus::SocketCan;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::plan::NodePlan;
use canopen_tools::diagnostics::beats::Beats;
use canopen_tools::diagnostics::presence::Presence;
use config::Config;
use run::exit::{Failure, Kind, OrFail};
use run::signal_flag;

/// Options that select the bus.
#[derive(Debug, Args)]
pub(crate) struct BusArgs {
    /// SocketCAN interface; with a configuration also the name of one of its buses, or BUS=INTERFACE.
    #[arg(short, long, value_name = "INTERFACE", global = true)]
    interface: Option<String>,
    /// Configuration with interface, nodes and EDS files.
    #[arg(short, long, value_name = "FILE", global = true)]
    config: Option<PathBuf>,
}

/// Permission to command or write while a master runs.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct ForceArg {
    /// Proceed although a master sends SYNC on this bus; a running node stops.
    #[arg(long, global = true)]
    pub(crate) force: bool,
}

/// Bus by its interface, with its configuration if one was given.
#[derive(Debug)]
pub(crate) struct SelectedBus {
    /// SocketCAN interface.
    pub(crate) interface: String,
    /// Configuration, and the channel of this bus in it.
    pub(crate) configured: Option<(Config, Channel)>,
}

impl BusArgs {
    /// Selects the bus without opening it.
    pub(crate) fn select(&self) -> Result<SelectedBus, Failure> {
        self.select_for([])
    }

    /// Selects the bus without opening it. Without an interface it is the bus of the first named node.
    pub(crate) fn select_for<'n>(
        &self,
        nodes: impl IntoIterator<Item = &'n NodeArg>,
    ) -> Result<SelectedBus, Failure> {
        let given = self.interface.as_deref();
        let Some(file) = &self.config else {
            let interface = given.ok_or_else(|| {
                Failure::new(Kind::Usage, "no bus selected: give -i INTERFACE or --config FILE")
            })?;
            return Ok(SelectedBus { interface: interface.to_owned(), configured: None });
        };
        let config = Config::load(file).or_fail(Kind::Configuration)?;
        let mut named = nodes.into_iter().map(|node| node.find(&config));
        let home = named.find_map(Result::transpose).transpose()?.map(|(channel, _)| channel);
        let (channel, interface) = choose(&config, given, home)?;
        Ok(SelectedBus { interface, configured: Some((config, channel)) })
    }
}

impl SelectedBus {
    /// Opens the interface.
    pub(crate) fn open(&self) -> Result<Session<SocketCan>, Failure> {
        let bus = SocketCan::open(std::slice::from_ref(&self.interface)).or_fail(Kind::Bus)?;
        // A session aborts its transfer in order.
        Ok(Session::new(bus, Channel(0), signal_flag::register([SIGINT, SIGTERM])?))
    }

    /// Opens the interface to command or write; refuses while a master sends SYNC on it, unless forced.
    pub(crate) fn open_to_command(
        &self,
        ForceArg { force }: ForceArg,
    ) -> Result<Session<SocketCan>, Failure> {
        self.open_listening(ForceArg { force }).map(|(session, _)| session)
    }

    /// Opens the interface as [`open_to_command`](Self::open_to_command), and returns the heartbeats received meanwhile.
    pub(crate) fn open_listening(
        &self,
        ForceArg { force }: ForceArg,
    ) -> Result<(Session<SocketCan>, Beats), Failure> {
        let mut session = self.open()?;
        if force {
            return Ok((session, Beats::default()));
        }
        let mut presence = Presence::start(session.now());
        if !session.resume(&mut presence).map_err(|error| self.fail(error))? {
            return Ok((session, presence.into_beats()));
        }
        let reason = format!(
            "{}: a master sends SYNC on this bus and would be disturbed; stop it first, or add --force",
            self.interface
        );
        Err(Failure::new(Kind::Bus, reason))
    }

    /// Converts the error of a session on this bus to a failure.
    pub(crate) fn fail(&self, error: SessionError) -> Failure {
        match error {
            SessionError::Interrupted => Failure::new(Kind::Negative, error),
            SessionError::Down | SessionError::BusOff | SessionError::Stuck => {
                Failure::new(Kind::Bus, format!("{}: {error}", self.interface))
            }
        }
    }

    /// Returns the node-id of an argument; a name must be that of a node on this bus.
    pub(crate) fn node(&self, node: &NodeArg) -> Result<NodeId, Failure> {
        let (name, (config, channel)) = match (node, &self.configured) {
            (NodeArg::Id(id), _) => return Ok(*id),
            (NodeArg::Name(name), Some(configured)) => (name, configured),
            (NodeArg::Name(name), None) => {
                let reason = format!(
                    "unknown node \"{name}\"; expected a node-id within 1..=127, or the name of a joint and --config FILE"
                );
                return Err(Failure::new(Kind::Usage, reason));
            }
        };
        let found = node.find(config)?.filter(|(home, _)| home == channel);
        found.map(|(_, id)| id).ok_or_else(|| {
            Failure::new(Kind::Usage, format!("{name} is on another bus than {}", self.interface))
        })
    }

    /// Returns the configured nodes of this bus; `None` without a configuration.
    pub(crate) fn plans(&self) -> Option<Vec<NodePlan>> {
        let (config, channel) = self.configured.as_ref()?;
        let plans = config.node_plans().into_iter().filter(|(of, _)| of == channel);
        Some(plans.map(|(_, plan)| plan).collect())
    }

    /// Returns the EDS of a node of this bus, if configured.
    pub(crate) fn eds(&self, node: NodeId) -> Option<&Eds> {
        let (config, channel) = self.configured.as_ref()?;
        config.eds_of(*channel, node)
    }
}

/// Selects a bus of a configuration and its interface by `joints`, `joints=can0` or `can0`; `None` selects the only
/// bus, or that of `home`.
fn choose(
    config: &Config,
    given: Option<&str>,
    home: Option<Channel>,
) -> Result<(Channel, String), Failure> {
    let (name, interface) = match given.and_then(|given| given.split_once('=')) {
        Some((name, interface)) => (Some(name), Some(interface)),
        None => (given, None),
    };
    let mut buses = config.channels().into_iter().zip(&config.buses);
    let only = if config.buses.len() == 1 { buses.clone().next() } else { None };
    let at_home = home.and_then(|home| buses.clone().find(|(channel, _)| *channel == home));
    let named = |name| {
        let is_it = |bus: &str, of: &str| bus == name || (interface.is_none() && of == name);
        buses.find(|(_, bus)| is_it(&bus.name, &bus.interface))
    };
    let found = name.map_or(at_home.or(only), named);
    match (found, only, name) {
        (Some((channel, bus)), ..) => Ok((channel, interface.unwrap_or(&bus.interface).to_owned())),
        // An interface that is not in the configuration, for its only bus.
        (None, Some((channel, _)), Some(given)) if interface.is_none() => {
            Ok((channel, given.to_owned()))
        }
        _ => {
            let names: Vec<&str> = config.buses.iter().map(|bus| bus.name.as_str()).collect();
            let given = given
                .map_or("no bus selected".to_owned(), |given| format!("-i {given}: unknown bus"));
            let example = names.first().unwrap_or(&"joints");
            Err(Failure::new(
                Kind::Usage,
                format!(
                    "{given}; expected -i BUS or BUS=INTERFACE, as {example} or {example}=can0, with BUS one of {}",
                    names.join(", ")
                ),
            ))
        }
    }
}
