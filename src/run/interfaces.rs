//! `-i`: which SocketCAN interface each bus of the configuration is on.

use clap::Args;

use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;
use bus::SocketCan;
use config::Config;

/// Overriding interfaces.
#[derive(Debug, Args)]
pub struct Interfaces {
    /// The interface of the one bus, or NAME=INTERFACE of one of several. Repeatable.
    #[arg(short = 'i', long = "interface", value_name = "[BUS=]INTERFACE")]
    pub interfaces: Vec<String>,
}

/// The interface of each bus, in the configuration's order, with the overrides applied.
///
/// # Errors
/// An override of a bus that the configuration does not have.
pub fn resolve(config: &Config, overrides: &[String]) -> Result<Vec<String>, Failure> {
    let mut interfaces: Vec<String> =
        config.buses.iter().map(|bus| bus.interface.clone()).collect();
    for given in overrides {
        let (place, interface) = match given.split_once('=') {
            Some((name, interface)) => {
                let place = config.buses.iter().position(|bus| bus.name == name);
                (place.ok_or_else(|| no_such_bus(config, name))?, interface)
            }
            None if config.buses.len() == 1 => (0, given.as_str()),
            None => return Err(ambiguous(config, given)),
        };
        if let Some(slot) = interfaces.get_mut(place) {
            interface.clone_into(slot);
        }
    }
    Ok(interfaces)
}

/// The buses of a node, on interfaces that are fit for torques; what is to be said of them is a warning.
pub(super) fn open(config: &Config, names: &[String]) -> Result<SocketCan, Failure> {
    let bus = SocketCan::open(names).or_fail(Kind::Bus)?;
    let bus = bus.with_filters(&config.patterns()).and_then(SocketCan::with_transmit_confirmation);
    let fit = bus.or_fail(Kind::Bus)?.fit_for_torques(config.bursts());
    let (bus, remarks) = fit.or_fail(Kind::Bus)?;
    for remark in remarks {
        tracing::warn!("{remark}");
    }
    Ok(bus)
}

fn no_such_bus(config: &Config, name: &str) -> Failure {
    Failure::new(
        Kind::Usage,
        format!("-i {name}=…: no bus of that name; there is {}", names(config)),
    )
}

fn ambiguous(config: &Config, given: &str) -> Failure {
    let names = names(config);
    Failure::new(Kind::Usage, format!("-i {given}: which bus? Say NAME={given}; there is {names}"))
}

fn names(config: &Config) -> String {
    config.buses.iter().map(|bus| bus.name.as_str()).collect::<Vec<_>>().join(", ")
}
