//! The robot's thread: a cycle per period, with the messages of the node in between.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::robot::clock::{Clock, next_due};
use crate::robot::narrator::{Event, Narrator};
use crate::robot::outlet::Outlet;
use crate::robot::report::Report;
use bus::realtime;
use far_socket::FarSocket;
use testbench::far_robot::FarRobot;

/// Cycles after a stop signal, in which the robot says that it ends.
const LAST_CYCLES: u32 = 10;

/// Requests to the robot's thread.
#[derive(Debug, Default)]
pub(super) struct Requests {
    stop: AtomicBool,
    report: AtomicBool,
}

impl Requests {
    /// Requests an end.
    pub(super) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Requests a status line.
    pub(super) fn report(&self) {
        self.report.store(true, Ordering::Relaxed);
    }

    /// Passes the status on if it is requested and there is room.
    fn answer(&self, outlet: &Outlet, report: impl FnOnce() -> Report) {
        if self.report.load(Ordering::Relaxed) && outlet.report(report) {
            self.report.store(false, Ordering::Relaxed);
        }
    }

    /// Returns whether an end is requested.
    pub(super) fn is_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Runs cycles of `period` until an end is requested, and a few more that say so.
pub(super) fn run(
    robot: &mut FarRobot,
    link: &mut FarSocket,
    clock: Clock,
    period: Duration,
    requests: &Requests,
    outlet: &Outlet,
) {
    realtime::ask();
    let mut narrator = Narrator::default();
    let mut due = clock.now();
    let mut last_cycles = LAST_CYCLES;
    while last_cycles > 0 {
        if requests.is_stop() {
            robot.end();
            last_cycles -= 1;
        }
        // Each message gets a time after its arrival: after a stop of this process in between, it is old.
        link.receive(clock.now(), |bytes| robot.on_message(clock.now(), bytes));
        let now = clock.now();
        let outgoing = robot.step(now);
        link.send(now, &outgoing.feedback);
        if let Some(capability) = outgoing.capability {
            link.send(now, &capability);
        }
        link.events().for_each(|event| outlet.event(Event::Socket(event)));
        narrator.observe(robot.leader(), robot.reason()).for_each(|event| outlet.event(event));
        requests.answer(outlet, || Report {
            status: robot.status(),
            is_connected: link.is_connected(),
        });
        due = next_due(due, clock.now(), period);
        clock.wait(due);
    }
}
