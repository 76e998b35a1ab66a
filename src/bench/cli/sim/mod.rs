//! `frhc sim`: simulated drives, switch box, arm and operator on SocketCAN, for any master.
//!
//! One thread serves the bus and owns the simulated world; the main thread waits for signals and prints. They share
//! two flags and a queue, so that slow output never delays a drive.

mod report;

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use anyhow::Context;
use tokio::sync::mpsc;

use crate::args::Sim;
use crate::os_signals::{Asked, Signals};
use crate::rig;
use bus::SocketCan;
use bus::realtime::{self, Settings};
use canopen::frame::Channel;
use config::Config;
use demo::event_narrator::EventNarrator;
use demo::{quirks, scenario};
use faults::{Fault, Target};
use run::exit::{Failure, Kind, OrFail};
use run::{interfaces, log_time, print};
use sim::drive_view::Report;
use sim::fault::Notice;
use sim::scenario::Scenario;
use sim::world::World;
use telemetry::origin::Origin;
use testbench::transmit_queue::Down;
use testbench::{station, world};
use units::time::Instant;

/// Serves the bus until a stop signal; prints the state of the drives at the end and on request.
pub(super) fn run(args: &Sim) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    if args.rig.is_chosen() {
        return rig::run(&args.rig, &config, args.seed);
    }
    let scenario = scenario_of(args, &config)?;
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("cannot start the async runtime").or_fail(Kind::System)?;
    // Until here a signal ends the process at once.
    let signals = runtime.block_on(async { Signals::install() });
    let signals = signals.context("cannot receive signals").or_fail(Kind::System)?;
    let bus = SocketCan::open(&names).and_then(SocketCan::with_remote_frames);
    let bus = bus.and_then(SocketCan::with_own_frames);
    let mut bus = bus.or_fail(Kind::Bus)?;
    log_time::set_clock(bus.clock());
    tracing::info!("time counts from {}", Origin::from_micros(bus.epoch_micros()));
    let mut world = world::build(&config, scenario, args.seed).ahead_of_sync();

    tracing::info!(interfaces = names.join(" "), "simulated drives are on the bus");
    let print_report = |report: &Report| {
        print::line(&if args.json {
            report::json(&config, report).to_string()
        } else {
            report::text(&config, report)
        });
    };
    let flags = Flags::default();
    let (report_sender, reports) = mpsc::channel(1);
    let (fault_sender, faults) = mpsc::unbounded_channel();
    let narrator = EventNarrator::new(&config);
    let ended = thread::scope(|threads| {
        let bus_thread = threads.spawn(|| {
            let granted = realtime::ask_for(Settings { fifo: args.fifo, ..Settings::default() });
            if !granted.is_fifo {
                tracing::warn!("SCHED_FIFO refused: the drives keep the priority that they have");
            }
            let (report_sender, fault_sender) = (report_sender, fault_sender);
            station::run(&mut bus, &mut world, &mut |world: &mut World| {
                while let Some(notice) = world.next_notice() {
                    // The main thread may have ended first.
                    let begun = world.scenario_start().unwrap_or(Instant::ZERO);
                    fault_sender.send((begun, notice)).ok();
                }
                flags.apply(world, &report_sender)
            })
        });
        runtime.block_on(serve(signals, reports, faults, &flags, &narrator, print_report));
        bus_thread.join()
    });
    print_report(&Report::new(&world));
    match ended {
        Ok(Ok(())) => Ok(()),
        Ok(Err(Down(channel))) => Err(Failure::new(Kind::Bus, down(&names, channel))),
        Err(_) => Err(Failure::new(Kind::Bus, "the simulation thread panicked")),
    }
}

/// Reads the scenario with the quirks of the command line, and warns of faults without effect.
fn scenario_of(args: &Sim, config: &Config) -> Result<Scenario, Failure> {
    let mut scenario = scenario::load(&args.scenario)?;
    args.quirks.assign(config, scenario.quirks_mut())?;
    quirks::check(config, scenario.quirks())?;
    let is_of_node = |fault: &Fault| fault.target == Target::Link || fault.is_of_host();
    if scenario.faults().iter().any(is_of_node) {
        tracing::warn!(
            "faults of host, buses and link have no effect here: they are on the node's side"
        );
    }
    if config.switches.is_none() && scenario.needs_switch_box() {
        tracing::warn!("no [switches]: the switches of the scenario act on nothing");
    }
    Ok(scenario)
}

/// Requests to the bus thread.
#[derive(Debug, Default)]
struct Flags {
    stop: AtomicBool,
    report: AtomicBool,
}

impl Flags {
    /// Sends a report if one is requested and the last was received; returns whether to stop.
    fn apply(&self, world: &World, reports: &mpsc::Sender<Report>) -> bool {
        if self.report.load(Ordering::Relaxed)
            && let Ok(room) = reports.try_reserve()
        {
            self.report.store(false, Ordering::Relaxed);
            room.send(Report::new(world));
        }
        self.stop.load(Ordering::Relaxed)
    }
}

/// Forwards signals and prints reports and injected faults, until the bus thread has ended.
async fn serve(
    mut signals: Signals,
    mut reports: mpsc::Receiver<Report>,
    mut faults: mpsc::UnboundedReceiver<(Instant, Notice)>,
    flags: &Flags,
    narrator: &EventNarrator,
    print_report: impl Fn(&Report),
) {
    loop {
        tokio::select! {
            report = reports.recv() => match report {
                Some(report) => print_report(&report),
                None => return,
            },
            Some((begun, notice)) = faults.recv() => {
                // Link faults act only inside the node.
                if notice.fault.target != Target::Link {
                    print::note(&narrator.fault(begun, &notice));
                }
            }
            asked = signals.next() => match asked {
                Asked::Report => flags.report.store(true, Ordering::Relaxed),
                Asked::End(signal) if !flags.stop.load(Ordering::Relaxed) => {
                    tracing::info!(signal, "leaving the bus");
                    flags.stop.store(true, Ordering::Relaxed);
                }
                Asked::End(_) => {}
            },
        }
    }
}

fn down(names: &[String], Channel(place): Channel) -> String {
    let name = names.get(usize::from(place)).map_or("an interface", String::as_str);
    format!("{name}: interface down")
}
