//! Benchmark of a millisecond of the simulated world: six drives with SYNC and target torques, the arm, and a hand on
//! its grip.
//!
//! `cargo bench --bench world` prints the median, the 99th percentile and the maximum of a cycle, of the
//! dynamics alone and of all of it; with `-- --cycles N` it plays N cycles and prints nothing, and with
//! `-- --dynamics N` N milliseconds of the dynamics, for counting instructions (`scripts/bench.sh`).
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::disallowed_methods,
    reason = "a benchmark prints, and cannot go on without what it needs"
)]

use std::cell::RefCell;
use std::hint::black_box;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant as Clock};

use canopen::frame::{Channel, Telegram};
use canopen::sync;
use canopen_device::station::Station;
use config::Config;
use sim::hand::Hand;
use sim::scenario::Scenario;
use sim::world::World;
use testbench::bench::Bench;
use units::time::Instant;

const CONFIG: &str = "config/kraft_like.toml";
const SCENARIO: &str = include_str!("../config/scenarios/contact_10s.toml");

/// Time at which the hand presses the object into the wall, in cycles.
const PRESSED: u64 = 4_500;

/// Number of cycles whose frames are replayed in a loop.
const SPAN: u64 = 500;

/// Quantity to measure.
const CYCLES: usize = 100_000;

fn main() {
    let (world, frames) = pressed();
    if let Some(cycles) = argument("--cycles") {
        black_box(Player::new(world, &frames).take(cycles).last());
    } else if let Some(cycles) = argument("--dynamics") {
        black_box(dynamics(&world).take(cycles).last());
    } else {
        print("dynamics, hand holding", dynamics(&world).take(CYCLES));
        print("the whole world", Player::new(world, &frames).take(CYCLES));
    }
}

fn argument(name: &str) -> Option<usize> {
    std::env::args().skip_while(|arg| arg != name).nth(1)?.parse().ok()
}

fn print(what: &str, spans: impl Iterator<Item = Duration>) {
    let mut spans: Vec<f64> = spans.map(|span| span.as_secs_f64() * 1e6).collect();
    spans.sort_by(f64::total_cmp);
    let at = |percent: usize| spans[(spans.len() - 1) * percent / 100];
    println!(
        "{what}, a millisecond of it: p50 {:.2} µs, p99 {:.2} µs, max {:.1} µs ({} cycles)",
        at(50),
        at(99),
        at(100),
        spans.len()
    );
}

/// Returns the world during contact, and the node's frames from then on.
fn pressed() -> (World, Vec<(Instant, Telegram)>) {
    let config = Config::load(Path::new(CONFIG)).unwrap();
    let recorded = Rc::new(RefCell::new(Vec::new()));
    let tap = Rc::clone(&recorded);
    let tap = move |at: Instant, telegram: &Telegram| tap.borrow_mut().push((at, *telegram));
    let scenario = Scenario::parse(SCENARIO).unwrap();
    let mut bench = Bench::new(&config, scenario, 1, tap);
    bench.bring_up().unwrap();
    bench.run(PRESSED);
    let world = bench.world_mut().clone();
    recorded.borrow_mut().clear();
    bench.run(SPAN + 1);
    let frames = recorded.take().into_iter().filter(|(_, telegram)| is_of_node(telegram));
    let mut frames: Vec<_> = frames.skip_while(|(_, telegram)| !is_sync(telegram)).collect();
    // Frames of the last cycle are still on the wire.
    let last = frames.iter().rposition(|(_, telegram)| is_sync(telegram)).unwrap();
    frames.truncate(last);
    (world, frames)
}

/// Returns whether a frame is SYNC, a target torque or the node's heartbeat.
fn is_of_node(telegram: &Telegram) -> bool {
    matches!(telegram.frame.cob_id, 0x080 | 0x200..0x280 | 0x77F)
}

fn is_sync(telegram: &Telegram) -> bool {
    telegram.channel == Channel(0) && telegram.frame.cob_id == sync::COB_ID
}

/// Measures a millisecond of the arm's dynamics, repeatedly.
fn dynamics(world: &World) -> impl Iterator<Item = Duration> + '_ {
    let (mut plant, hand, x_0_d) = (*world.plant(), Hand::default(), *world.plant().x_0_g());
    let tau = world.torques();
    std::iter::repeat_with(move || {
        let begun = Clock::now();
        plant.advance(1e-3, black_box(&tau), Some((&hand, &x_0_d)));
        black_box(&plant);
        begun.elapsed()
    })
}

/// Replays the node's frames to the world in a loop.
struct Player<'f> {
    world: World,
    frames: std::iter::Peekable<std::iter::Cycle<std::slice::Iter<'f, (Instant, Telegram)>>>,
    /// Time offset of the present pass of the loop.
    shift: Duration,
    last: Instant,
    out: Vec<Telegram>,
}

impl<'f> Player<'f> {
    fn new(world: World, frames: &'f [(Instant, Telegram)]) -> Self {
        Self {
            world,
            frames: frames.iter().cycle().peekable(),
            shift: Duration::ZERO,
            last: Instant::ZERO,
            out: Vec::with_capacity(64),
        }
    }

    /// Runs the world until `until`.
    fn wait(&mut self, until: Instant) {
        while let Some(due) = self.world.deadline().filter(|due| *due <= until) {
            self.world.on_time(due.max(self.last), &mut self.out);
            self.last = due.max(self.last);
        }
    }
}

/// Runs from one SYNC until before the next.
impl Iterator for Player<'_> {
    type Item = Duration;

    fn next(&mut self) -> Option<Duration> {
        let begun = Clock::now();
        self.out.clear();
        loop {
            let (sent, telegram) = self.frames.next()?;
            if *sent + self.shift < self.last {
                self.shift += Duration::from_millis(SPAN);
            }
            let at = *sent + self.shift;
            self.wait(at);
            self.last = at;
            self.world.on_frame(at, telegram.channel, &telegram.frame, &mut self.out);
            if self.frames.peek().is_some_and(|(_, telegram)| is_sync(telegram)) {
                break;
            }
        }
        assert!(self.out.len() >= 6, "{} answers", self.out.len());
        Some(begun.elapsed())
    }
}
