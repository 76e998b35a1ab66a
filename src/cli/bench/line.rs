//! Which bus a tool talks on, and what is known of it.

use std::path::PathBuf;

use clap::Args;

use crate::cli::bench::Session;
use crate::cli::bench::SessionError;
use crate::cli::bench::interrupt;
use bus::SocketCan;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::plan::NodePlan;
use canopen_tools::diagnostics::presence::Presence;
use config::Config;
use run::exit::Failure;
use run::exit::Kind;
use run::exit::OrFail;

/// What every tool takes to find its bus.
#[derive(Debug, Args)]
pub(crate) struct Line {
    /// The SocketCAN interface; with a configuration also the name of one of its buses, or BUS=INTERFACE.
    #[arg(short, long, value_name = "INTERFACE", global = true)]
    interface: Option<String>,
    /// A configuration: its interface, its nodes and their EDS files.
    #[arg(short, long, value_name = "FILE", global = true)]
    config: Option<PathBuf>,
}

/// Whether a tool that commands or writes does so although a master runs.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Beside {
    /// Go on although a master sends SYNC on this bus: a node that runs there stops.
    #[arg(long, global = true)]
    pub(crate) force: bool,
}

/// The bus that was meant.
#[derive(Debug)]
pub(crate) struct Known {
    /// Its interface.
    pub(crate) interface: String,
    /// What was configured, and which of its buses this is.
    pub(crate) configured: Option<(Config, Channel)>,
}

impl Line {
    /// Finds the bus; opens nothing.
    pub(crate) fn find(&self) -> Result<Known, Failure> {
        let given = self.interface.as_deref();
        let Some(file) = &self.config else {
            let interface = given.ok_or_else(|| {
                Failure::new(Kind::Usage, "which bus? Say -i INTERFACE or --config FILE")
            })?;
            return Ok(Known { interface: interface.to_owned(), configured: None });
        };
        let config = Config::load(file).or_fail(Kind::Configuration)?;
        let (channel, interface) = choose(&config, given)?;
        Ok(Known { interface, configured: Some((config, channel)) })
    }
}

impl Known {
    /// Opens the interface.
    pub(crate) fn open(&self) -> Result<Session<SocketCan>, Failure> {
        let bus = SocketCan::open(std::slice::from_ref(&self.interface)).or_fail(Kind::Bus)?;
        Ok(Session::new(bus, Channel(0), interrupt::flag()?))
    }

    /// Opens the interface to command or write: refused while a master sends SYNC there, unless forced.
    pub(crate) fn open_to_command(
        &self,
        Beside { force }: Beside,
    ) -> Result<Session<SocketCan>, Failure> {
        let mut session = self.open()?;
        if force || !session.run(|now, _| Presence::start(now)).map_err(|error| self.fail(error))? {
            return Ok(session);
        }
        let reason = format!(
            "{}: a master sends SYNC here, and would be disturbed; stop it first, or say --force",
            self.interface
        );
        Err(Failure::new(Kind::Bus, reason))
    }

    /// A talk on this bus that has ended before its time.
    pub(crate) fn fail(&self, error: SessionError) -> Failure {
        match error {
            SessionError::Interrupted => Failure::new(Kind::Negative, error),
            SessionError::Down | SessionError::BusOff | SessionError::Stuck => {
                Failure::new(Kind::Bus, format!("{}: {error}", self.interface))
            }
        }
    }

    /// What is configured to be on this bus; `None` without a configuration.
    pub(crate) fn plans(&self) -> Option<Vec<NodePlan>> {
        let (config, channel) = self.configured.as_ref()?;
        let plans = config.node_plans().into_iter().filter(|(of, _)| of == channel);
        Some(plans.map(|(_, plan)| plan).collect())
    }

    /// What the configuration says of a node's objects.
    pub(crate) fn eds(&self, node: NodeId) -> Option<&Eds> {
        let (config, channel) = self.configured.as_ref()?;
        let is_it = |(of, id): (Channel, NodeId)| of == *channel && id == node;
        let joint = config.joints.iter().find(|joint| is_it((joint.channel, joint.node)));
        let switches = Some(&config.switches).filter(|box_| is_it((box_.channel, box_.node)));
        joint.map(|joint| &joint.eds).or_else(|| switches.map(|switches| &switches.eds))
    }
}

/// The bus of a configuration, and its interface: `joints`, `joints=can0`, `can0`, or nothing where there
/// is one bus only.
fn choose(config: &Config, given: Option<&str>) -> Result<(Channel, String), Failure> {
    let (name, interface) = match given.and_then(|given| given.split_once('=')) {
        Some((name, interface)) => (Some(name), Some(interface)),
        None => (given, None),
    };
    let mut buses = config.channels().into_iter().zip(&config.buses);
    let only = if config.buses.len() == 1 { buses.clone().next() } else { None };
    let named = |name| {
        let is_it = |bus: &str, of: &str| bus == name || (interface.is_none() && of == name);
        buses.find(|(_, bus)| is_it(&bus.name, &bus.interface))
    };
    let found = name.map_or(only, named);
    match (found, only, name) {
        (Some((channel, bus)), ..) => Ok((channel, interface.unwrap_or(&bus.interface).to_owned())),
        // An interface the configuration does not know, on the one bus there is.
        (None, Some((channel, _)), Some(given)) if interface.is_none() => {
            Ok((channel, given.to_owned()))
        }
        _ => {
            let names: Vec<&str> = config.buses.iter().map(|bus| bus.name.as_str()).collect();
            let given =
                given.map_or("which bus?".to_owned(), |given| format!("-i {given}: which bus?"));
            let example = names.first().unwrap_or(&"joints");
            Err(Failure::new(
                Kind::Usage,
                format!(
                    "{given} Say -i {example}, or {example}=INTERFACE; there is {}",
                    names.join(", ")
                ),
            ))
        }
    }
}
