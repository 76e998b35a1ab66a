//! `frhc top`: a running node in a terminal. Keys change the view; nothing is sent to the node.
//!
//! `state` is what was received, `view` draws it, `screen` is the terminal.

mod budget;
mod choices;
mod head;
mod joints;
mod keys;
mod links;
mod number;
mod page;
mod palette;
mod screen;
mod state;
#[cfg(test)]
mod tests;
mod text;
mod timing;
mod value;
mod view;
mod wrenches;

use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGWINCH};

use self::choices::View;
use self::palette::Palette;
use self::screen::{DRAWINGS_PER_S, Event, Screen};
use self::state::State;
use self::view::Scene;
use crate::feed::{FeedReader, Kind, News};
use run::exit::{Failure, Kind as FailureKind, OrFail};
use run::{print, signal_flag};

/// Columns of a snapshot that no terminal shows.
const SNAPSHOT_COLUMNS: usize = 80;

/// Time allowed for each line of the node, when one snapshot is to be printed.
const LINE_TIMEOUT: Duration = Duration::from_secs(3);

/// Number of mode lines after which a snapshot is not waited for: a boot sends none.
const MODES_WITHOUT_SNAPSHOT: u32 = 3;

/// Time without a line that is remarked on, in s.
const SILENCE_S: u64 = 2;

/// Shows the node that listens on the first of these sockets until a key or a signal ends it.
///
/// # Errors
/// Returns an error if there is no terminal, or it cannot be used.
pub fn watch(sockets: Vec<PathBuf>) -> Result<(), Failure> {
    let is_dumb = std::env::var_os("TERM").is_none_or(|name| name.is_empty() || name == "dumb");
    if is_dumb || !io::stdout().is_terminal() || !io::stdin().is_terminal() {
        let reason = "top needs a terminal (stdin, stdout, and a TERM that is not dumb); --once prints one snapshot";
        return Err(Failure::new(FailureKind::Usage, reason));
    }
    let is_ending = signal_flag::register([SIGHUP, SIGINT, SIGTERM])?;
    // A new size ends the wait for the next drawing.
    signal_flag::register([SIGWINCH])?;
    let state = Arc::new(Mutex::new(State::default()));
    let shared = Arc::clone(&state);
    let take_in = move |news| shared.lock().unwrap_or_else(PoisonError::into_inner).on_news(news);
    let _reader = FeedReader::start(sockets, take_in).or_fail(FailureKind::System)?;
    let mut screen = Screen::start().or_fail(FailureKind::File)?;
    let (mut view, mut shown) = (View::default(), State::default());
    let (mut received, mut silent_ticks) = (0, 0);
    let mut event = Event::Signal;
    while !is_ending.load(Ordering::Relaxed) {
        match event {
            Event::HungUp => return Ok(()),
            Event::Keys(bytes) => match keys::after(view, &bytes) {
                Some(after) => view = after,
                None => return Ok(()),
            },
            Event::Tick | Event::Signal => {
                let newest = state.lock().unwrap_or_else(PoisonError::into_inner).clone();
                let is_silent = newest.received == received;
                silent_ticks =
                    if is_silent { silent_ticks + u64::from(event == Event::Tick) } else { 0 };
                received = newest.received;
                if !view.is_paused {
                    shown = newest;
                }
                let silent_s = silent_ticks / DRAWINGS_PER_S;
                let silent_s = (silent_s >= SILENCE_S && received > 0).then_some(silent_s);
                let scene = Scene { state: &shown, view, palette: palette(), silent_s };
                // Fails where the terminal is gone.
                if screen.draw(&scene).is_err() {
                    return Ok(());
                }
            }
        }
        event = screen.wait().or_fail(FailureKind::File)?;
    }
    Ok(())
}

/// Prints one snapshot of the node that listens on the first of these sockets.
///
/// # Errors
/// Returns an error if there is no node, or it does not send.
pub fn print_once(sockets: Vec<PathBuf>) -> Result<(), Failure> {
    let (sender, news) = channel();
    // The receiver is gone when the snapshot is complete.
    let _reader = FeedReader::start(sockets, move |one| sender.send(one).unwrap_or_default())
        .or_fail(FailureKind::System)?;
    let state = first_snapshot(&news)?;
    let palette = Palette { is_coloured: false };
    let scene = Scene { state: &state, view: View::default(), palette, silent_s: None };
    for row in scene.all_rows(SNAPSHOT_COLUMNS) {
        print::line(row.to_string().trim_end());
    }
    Ok(())
}

/// Receives lines until there is a snapshot, or until a node that boots has said its mode.
fn first_snapshot(news: &Receiver<News>) -> Result<State, Failure> {
    let mut state = State::default();
    let mut modes = 0;
    while state.snapshot.is_null() && modes < MODES_WITHOUT_SNAPSHOT {
        let silence = |_| Failure::new(FailureKind::Bus, "the node sends no telemetry");
        let one = news.recv_timeout(LINE_TIMEOUT).map_err(silence)?;
        if matches!(&one, News::Line(line) if line.kind == Kind::Mode) {
            modes += 1;
        }
        state.on_news(one);
        if let Some(reason) = &state.absence {
            return Err(Failure::new(FailureKind::Bus, reason));
        }
    }
    Ok(state)
}

fn palette() -> Palette {
    Palette { is_coloured: std::env::var_os("NO_COLOR").is_none() }
}
