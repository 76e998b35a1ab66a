//! `-i`: the SocketCAN interface of each bus of the configuration.

use clap::Args;

use crate::exit::{Failure, Kind, OrFail};
use bus::SocketCan;
use config::Config;

/// Interfaces in place of those in the configuration.
#[derive(Debug, Args)]
pub struct Interfaces {
    /// SocketCAN interface of the bus; with several buses NAME=INTERFACE, once for each.
    #[arg(short = 'i', long = "interface", value_name = "[BUS=]INTERFACE")]
    pub interfaces: Vec<String>,
}

/// Returns the interface of each bus, in the configuration's order, with the overrides applied.
///
/// # Errors
/// When an override names a bus that is not in the configuration.
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
    each_once(config, &interfaces)?;
    Ok(interfaces)
}

/// Refuses one interface for two buses, where each would receive the frames of the other as those of a foreign master.
fn each_once(config: &Config, interfaces: &[String]) -> Result<(), Failure> {
    for (place, (interface, bus)) in interfaces.iter().zip(&config.buses).enumerate() {
        let mut others = interfaces.iter().zip(&config.buses).skip(place + 1);
        if let Some((_, other)) = others.find(|(other, _)| *other == interface) {
            let (bus, other) = (&bus.name, &other.name);
            let reason = format!(
                "-i: buses {bus} and {other} would both be on {interface}; each needs its own interface"
            );
            return Err(Failure::new(Kind::Usage, reason));
        }
    }
    Ok(())
}

/// Opens the buses of a node, on interfaces that are fit for torque control; logs their deficiencies as warnings.
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
        format!("-i {name}=…: unknown bus \"{name}\"; expected {}", names(config)),
    )
}

fn ambiguous(config: &Config, given: &str) -> Failure {
    let names = names(config);
    Failure::new(
        Kind::Usage,
        format!("-i {given}: the configuration has several buses ({names}); give NAME={given}"),
    )
}

fn names(config: &Config) -> String {
    config.buses.iter().map(|bus| bus.name.as_str()).collect::<Vec<_>>().join(", ")
}
