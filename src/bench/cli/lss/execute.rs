//! Execution of LSS tasks on a live bus, and their output.

use std::time::Duration;

use crate::live_bus::{ForceArg, SelectedBus, Session, SessionError};
use crate::lss::{Lss, Task};
use bus::Bus;
use canopen::NodeId;
use canopen_device::lss::Address;
use canopen_tools::diagnostics::scan::{NodeReport, Scan};
use canopen_tools::lss::identify::{Description, Identify};
use canopen_tools::lss::job::{Job, Report, Selection, Timeouts};
use canopen_tools::lss::master::Master;
use run::exit::{Failure, Kind, OrFail};
use run::print;

/// Runs a job and prints its result.
pub(super) fn run_job(args: &Lss, bus: &SelectedBus, job: Job) -> Result<(), Failure> {
    let reply = Duration::from_millis(args.timeout);
    let timeouts =
        Timeouts { reply, store: reply.max(Duration::from_secs(1)), probe: args.task.probe() };
    let is_harmless = matches!(args.task, Task::Deselect);
    let force = ForceArg { force: args.force.force || is_harmless };
    let mut session = bus.open_to_command(force)?;
    if let Some(Some(node)) = job.node {
        let owner = owner(&mut session, node, reply).map_err(|error| bus.fail(error))?;
        ensure_free(node, owner.as_ref(), job.selection)?;
    }
    let outcome = session.run(|now, out| Master::start(job, timeouts, now, out));
    let report = outcome.map_err(|error| bus.fail(error))?.or_fail(Kind::Drive)?;
    show(args.json, &report);
    print_remarks(&job, &report);
    Ok(())
}

/// Returns the node that has this node-id now, if any.
fn owner<B: Bus>(
    session: &mut Session<B>,
    node: NodeId,
    timeout: Duration,
) -> Result<Option<NodeReport>, SessionError> {
    let found = session.run(|now, out| Scan::start(&[node], timeout, Duration::ZERO, now, out))?;
    Ok(found.into_iter().find(|found| found.node == node))
}

/// Returns an error if another slave has this node-id. A slave chosen by its identity may have it already.
fn ensure_free(
    node: NodeId,
    owner: Option<&NodeReport>,
    selection: Selection,
) -> Result<(), Failure> {
    let is_its_own = |owner: &NodeReport| match selection {
        Selection::Address(address) => owner.address() == Some(address),
        Selection::Fastscan => false,
        Selection::Selected | Selection::All => true,
    };
    match owner.filter(|owner| !is_its_own(owner)) {
        None => Ok(()),
        Some(owner) => {
            let who = owner.address().map(|address| format!(" by {address}")).unwrap_or_default();
            Err(Failure::new(Kind::Drive, format!("node-id {} is in use{who}", node.raw())))
        }
    }
}

/// Checks whether slaves in these identity ranges, or without node-id, are present.
pub(super) fn identify(
    args: &Lss,
    bus: &SelectedBus,
    description: Option<Description>,
) -> Result<(), Failure> {
    let window = Duration::from_millis(args.timeout);
    let answers = bus
        .open()?
        .run(|now, out| match description {
            Some(description) => Identify::remote(description, window, now, out),
            None => Identify::non_configured(window, now, out),
        })
        .map_err(|error| bus.fail(error))?;
    if args.json {
        print::line(&serde_json::json!({ "found": answers > 0, "answers": answers }).to_string());
    }
    let which = if description.is_some() { "in these ranges" } else { "without node-id" };
    if answers == 0 {
        return Err(Failure::new(Kind::Drive, format!("no slave {which} responds")));
    }
    if !args.json {
        print::line(&format!("at least one slave {which}"));
    }
    Ok(())
}

/// Prints identity and node-id, as far as they were read.
fn show(json: bool, report: &Report) {
    let Report { address, node, is_booted } = *report;
    if json {
        let of_address = address.map(|Address { vendor, product, revision, serial }| {
            serde_json::json!({
                "vendor": vendor, "product": product, "revision": revision, "serial": serial,
            })
        });
        let node = node.map(|node| node.map_or(255, NodeId::raw));
        let report =
            serde_json::json!({ "address": of_address, "node": node, "booted": is_booted });
        print::line(&report.to_string());
        return;
    }
    if let Some(Address { vendor, product, revision, serial }) = address {
        let mut line = format!(
            "vendor 0x{vendor:08X}, product 0x{product:08X}, revision 0x{revision:08X}, serial 0x{serial:08X}"
        );
        if let Some(node) = node {
            let node = node.map_or("no node-id".to_owned(), |node| format!("node {}", node.raw()));
            line.push_str(&format!(", {node}"));
        }
        print::line(&line);
    }
}

/// Prints when the new settings take effect, and the state that the slave is left in.
fn print_remarks(job: &Job, report: &Report) {
    let booted = report.is_booted;
    match (job.node, report.node) {
        (Some(Some(new)), Some(None)) if booted => {
            print::note(&format!("node {} has booted up", new.raw()));
        }
        (Some(Some(new)), Some(None)) if job.release => {
            print::note(&format!("node {}: no boot-up received", new.raw()));
        }
        (Some(Some(_)), Some(None)) => print::note("in effect after: frhc lss deselect"),
        (Some(_), Some(Some(old))) => {
            print::note(&format!("in effect after: frhc nmt reset-comm {}", old.raw()));
        }
        (Some(_), None) => print::note("in effect after a reset of communication"),
        (None, _) | (Some(None), Some(None)) => {}
    }
    if job.node.is_some() && !job.store {
        print::note("not stored: lost at power-off; add --store or run `frhc lss store`");
    }
    if job.activate.is_some() {
        print::note("now set this interface to the new bit rate, before the slaves send again");
    }
    if !job.release {
        print::note("the slave stays selected until: frhc lss deselect");
    }
}
