//! `frhc sim`: simulated drives, switch box, arm and operator on SocketCAN, for any master.
//!
//! One thread lives on the bus and owns the world; this one waits for signals and prints. Between them
//! stand two flags and a queue, so that nobody who reads slowly holds up a drive.

mod report;

use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use anyhow::Context;
use tokio::sync::mpsc;

use crate::cli::args::Sim;
use crate::cli::rig;
use crate::cli::scenario;
use crate::cli::story::Story;
use bus::SocketCan;
use bus::realtime;
use canopen::frame::Channel;
use config::Config;
use lab::attend::attend;
use lab::outbox::Down;
use lab::world;
use run::exit::Failure;
use run::exit::Kind;
use run::exit::OrFail;
use run::interfaces;
use run::print;
use run::signals;
use run::signals::Inquiries;
use run::time_line;
use sim::drive_view::Report;
use sim::fault::Notice;
use sim::scenario::fault::Whom;
use sim::world::World;
use telemetry::origin::Origin;
use units::time::Instant;

/// Lives on the bus until a signal ends it; tells what each drive believes when asked to, and then.
pub(super) fn run(args: &Sim) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    if let Some(joint) = &args.rig.calibrate {
        return rig::run(&args.rig, &config, joint, args.seed);
    }
    let mut scenario = scenario::load(&args.scenario)?;
    args.quirks.assign(&config, scenario.quirks_mut())?;
    if scenario.faults().iter().any(|fault| fault.whom == Whom::Link) {
        tracing::warn!("faults of the link have no effect: the commanded side is the node's");
    }
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("no runtime").or_fail(Kind::Bus)?;
    // From here on an inquiry is answered; before, it would have ended the process.
    let inquiries = runtime.block_on(async { Inquiries::heard() });
    let inquiries = inquiries.context("no signals").or_fail(Kind::Bus)?;
    let bus = SocketCan::open(&names).and_then(SocketCan::with_remote_frames);
    let bus = bus.and_then(SocketCan::with_own_frames);
    let mut bus = bus.or_fail(Kind::Bus)?;
    time_line::start(bus.clock());
    tracing::info!("time counts from {}", Origin::from_micros(bus.epoch_micros()));
    let mut world = world::build(&config, scenario, args.seed);

    tracing::info!(interfaces = names.join(" "), "simulated drives are on the bus");
    let tell = |report: &Report| {
        print::line(&if args.json {
            report::json(&config, report).to_string()
        } else {
            report::text(&config, report)
        });
    };
    let flags = Flags::default();
    let (reports, told) = mpsc::channel(1);
    let (notices, broken) = mpsc::unbounded_channel();
    let story = Story::of(&config);
    let left = thread::scope(|threads| {
        let living = threads.spawn(|| {
            realtime::ask();
            let (reports, notices) = (reports, notices);
            attend(&mut bus, &mut world, &mut |world: &mut World| {
                while let Some(notice) = world.notice() {
                    // Whoever tells it may have gone before.
                    let begun = world.scenario_start().unwrap_or(Instant::ZERO);
                    notices.send((begun, notice)).ok();
                }
                flags.heed(world, &reports)
            })
        });
        runtime.block_on(serve(inquiries, told, broken, &flags, &story, tell));
        living.join()
    });
    tell(&Report::of(&world));
    match left {
        Ok(Ok(())) => Ok(()),
        Ok(Err(Down(channel))) => Err(Failure::new(Kind::Bus, down(&names, channel))),
        Err(_) => Err(Failure::new(Kind::Bus, "the simulation failed")),
    }
}

/// What the thread on the bus is asked.
#[derive(Debug, Default)]
struct Flags {
    is_over: AtomicBool,
    is_asked: AtomicBool,
}

impl Flags {
    /// Answers an inquiry if there is one and the last report has been taken; whether to end.
    fn heed(&self, world: &World, reports: &mpsc::Sender<Report>) -> bool {
        if self.is_asked.load(Ordering::Relaxed)
            && let Ok(room) = reports.try_reserve()
        {
            self.is_asked.store(false, Ordering::Relaxed);
            room.send(Report::of(world));
        }
        self.is_over.load(Ordering::Relaxed)
    }
}

/// Passes on signals, prints reports and tells what breaks, until the thread on the bus has ended.
async fn serve(
    mut inquiries: Inquiries,
    mut told: mpsc::Receiver<Report>,
    mut broken: mpsc::UnboundedReceiver<(Instant, Notice)>,
    flags: &Flags,
    story: &Story,
    tell: impl Fn(&Report),
) {
    let ended = signals::wait();
    tokio::pin!(ended);
    loop {
        tokio::select! {
            report = told.recv() => match report {
                Some(report) => tell(&report),
                None => return,
            },
            Some((begun, notice)) = broken.recv() => {
                // The commanded side is not here.
                if notice.fault.whom != Whom::Link {
                    print::note(&story.fault(begun, &notice));
                }
            }
            () = inquiries.next() => flags.is_asked.store(true, Ordering::Relaxed),
            signal = &mut ended, if !flags.is_over.load(Ordering::Relaxed) => {
                tracing::info!(signal, "leaving the bus");
                flags.is_over.store(true, Ordering::Relaxed);
            }
        }
    }
}

fn down(names: &[String], Channel(place): Channel) -> String {
    let name = names.get(usize::from(place)).map_or("an interface", String::as_str);
    format!("{name}: interface down")
}
