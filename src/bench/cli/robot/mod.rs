//! `frhc robot`: the simulated robot of `demo --robot` as a process of its own, the far side of docs/link.md.
//!
//! One thread owns the robot and its connection to the node; the main thread waits for signals, logs and prints. They share
//! two flags and a queue, so that slow output never delays the robot.

mod clock;
mod cycle;
mod narrator;
mod outlet;
mod report;
mod sensor;

use std::path::Path;
use std::thread;

use anyhow::Context;
use tokio::sync::mpsc;

use crate::args::Robot;
use crate::os_signals::{Asked, Signals};
use crate::robot::clock::Clock;
use crate::robot::cycle::{Ends, Requests};
use crate::robot::outlet::{Message, Outlet};
use crate::robot::report::Report;
use config::robots::RobotArm;
use config::{Config, FarSide};
use far_socket::FarSocket;
use run::exit::{Failure, Kind, OrFail};
use run::{commanded_side, log_time, print};
use testbench::far_robot::{FarRobot, RobotLimits, SensorRange};
use testbench::robot_site::NoRobot;

/// Runs the robot until a stop signal; prints its status at the end and on request.
pub(super) fn run(args: &Robot) -> Result<(), Failure> {
    let config = configuration(args)?;
    let robot = simulated(args, &config)?;
    let clock = Clock::start();
    let socket = args.socket.clone().unwrap_or_else(|| commanded_side::socket_of(&config));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("cannot start the async runtime").or_fail(Kind::System)?;
    // Until here a signal ends the process at once: handlers first, then what others can see.
    let signals = runtime.block_on(async { Signals::install() });
    let signals = signals.context("cannot receive signals").or_fail(Kind::System)?;
    let link = FarSocket::open(&socket).or_fail(Kind::Bus)?;
    let sensor = sensor::opened(&config, args.bias, clock.now())?;
    let mut ends = Ends { robot, link, sensor };
    log_time::set_clock(move || clock.now());
    let name = config.robot.as_ref().map_or("", |robot| robot.name.as_str());
    tracing::info!(arm = arm(args, &config), socket = %socket.display(), "{name}: holds until a node leads");

    let requests = Requests::default();
    let (outlet, messages) = Outlet::new();
    let ended = thread::scope(|threads| {
        let (ends, requests, period) = (&mut ends, &requests, config.period);
        // The thread owns the outlet, so that its end closes the channel.
        let cycles = threads.spawn(move || cycle::run(ends, clock, period, requests, &outlet));
        runtime.block_on(serve(signals, messages, requests, args));
        cycles.join()
    });
    print_report(args, &ends.report(clock.now()));
    ended.map_err(|_| Failure::new(Kind::Bus, "the robot's thread panicked"))
}

/// Returns the configuration, with the robot of the command line. It may be that of the node.
fn configuration(args: &Robot) -> Result<Config, Failure> {
    let file = &args.config.config;
    let config = Config::load(file).or_fail(Kind::Configuration)?;
    let config = match &args.robot {
        Some(robot) => config.with_robot(RobotArm::load(robot).or_fail(Kind::Configuration)?),
        None => config,
    };
    if config.robot.is_none() {
        let is_of_a_node =
            config.far_side.agreement.is_some() && config.far_side.model_limit.is_none();
        let remedy = if is_of_a_node { "" } else { "add the key, or " };
        let reason = format!("{}: remote.robot: absent; {remedy}give --robot FILE", file.display());
        return Err(Failure::new(Kind::Configuration, reason));
    }
    Ok(config)
}

/// Returns the number of the arm.
fn arm(args: &Robot, config: &Config) -> u16 {
    args.arm.unwrap_or(config.far_side.arm)
}

/// Returns the limits of a configuration.
fn limits(far_side: &FarSide) -> RobotLimits {
    let usual = RobotLimits::default();
    let [force, moment] = far_side.sensor_range;
    let sensor_range = SensorRange {
        force: force.unwrap_or(usual.sensor_range.force),
        moment: moment.unwrap_or(usual.sensor_range.moment),
    };
    let [force, moment] = far_side.wrench_limit;
    let mut wrench = usual.wrench;
    wrench.force = force.unwrap_or(wrench.force);
    wrench.moment = moment.unwrap_or(wrench.moment);
    let hold_after = far_side.hold_after.unwrap_or(usual.hold_after);
    RobotLimits { sensor_range, wrench, hold_after, ..usual }
}

/// Returns the robot of a configuration, with a random session.
fn simulated(args: &Robot, config: &Config) -> Result<FarRobot, Failure> {
    let limits = limits(&config.far_side);
    let robot = FarRobot::new(config, limits, arm(args, config), random_session()?, args.seed);
    robot.map_err(|refused| {
        let file = config.robot.as_ref().map_or(Path::new(""), |robot| &robot.file);
        let reason = match &refused {
            NoRobot::Invalid(invalid) => format!("{}: {invalid}", file.display()),
            NoRobot::NoArm
            | NoRobot::StartsInContact { .. }
            | NoRobot::Scenario(_)
            | NoRobot::BringUp(_) => refused.to_string(),
        };
        Failure::new(Kind::Configuration, reason)
    })
}

/// Returns a random number from the kernel, for the session of this process.
fn random_session() -> Result<u64, Failure> {
    getrandom::u64().context("no random session").or_fail(Kind::File)
}

/// Forwards signals, logs and prints, until the robot's thread has ended.
async fn serve(
    mut signals: Signals,
    mut messages: mpsc::Receiver<Message>,
    requests: &Requests,
    args: &Robot,
) {
    loop {
        tokio::select! {
            message = messages.recv() => match message {
                Some(Message::Event(event)) => event.log(),
                Some(Message::Report(report)) => print_report(args, &report),
                None => return,
            },
            asked = signals.next() => match asked {
                Asked::Report => requests.report(),
                Asked::End(signal) if !requests.is_stop() => {
                    tracing::info!(signal, "ends");
                    requests.stop();
                }
                Asked::End(_) => {}
            },
        }
    }
}

fn print_report(args: &Robot, report: &Report) {
    print::line(&if args.json { report.json().to_string() } else { report.text() });
}
