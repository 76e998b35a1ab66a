//! Newest lines of the feed for all viewers. A slow viewer misses lines; they are not kept for it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Waker;

use axum::body::Bytes;

use crate::feed::{Kind, News};

/// Maximum number of viewers at a time.
pub(super) const MAX_VIEWERS: usize = 64;

/// Number of lines after which a viewer that has read none of them misses some.
const MAX_RECENT: usize = 16;

/// Line as an event of Server-Sent Events, with its number in the order of arrival.
#[derive(Clone, Debug)]
struct Event {
    number: u64,
    text: Bytes,
}

#[derive(Debug, Default)]
struct State {
    /// Number of the newest event; the first is 1.
    newest: u64,
    /// Newest events, oldest first.
    recent: VecDeque<Event>,
    /// Newest event of each kind that a late viewer needs.
    description: Option<Event>,
    mode: Option<Event>,
    snapshot: Option<Event>,
    absent: Option<Event>,
    /// Viewers by their number, each with its waker while it waits.
    viewers: BTreeMap<u64, Option<Waker>>,
    last_viewer: u64,
}

/// Newest lines, and the viewers that wait for more.
#[derive(Debug, Default)]
pub(super) struct Hub {
    state: Mutex<State>,
}

/// Place of a viewer, released on drop.
#[derive(Debug)]
pub(super) struct Seat {
    hub: Arc<Hub>,
    viewer: u64,
    /// Number of the last event that was taken; `None` before the first.
    seen: Option<u64>,
}

impl Hub {
    /// Passes news to all viewers.
    pub(super) fn publish(&self, news: &News) {
        let mut state = self.state();
        state.newest += 1;
        let number = state.newest;
        match news {
            News::Line(line) => {
                let event = Event { number, text: event(name(line.kind), &line.text) };
                match line.kind {
                    Kind::Description => {
                        state.forget();
                        state.description = Some(event.clone());
                    }
                    Kind::Mode => state.mode = Some(event.clone()),
                    Kind::Snapshot => state.snapshot = Some(event.clone()),
                    Kind::Other => {}
                }
                state.push(event);
            }
            News::Absent(reason) => {
                let text = serde_json::json!({ "reason": reason }).to_string();
                let event = Event { number, text: event("absent", &text) };
                state.forget();
                state.absent = Some(event.clone());
                state.push(event);
            }
        }
        let wakers: Vec<Waker> = state.viewers.values_mut().filter_map(Option::take).collect();
        drop(state);
        wakers.into_iter().for_each(Waker::wake);
    }

    /// Returns a place for one more viewer, unless all are taken.
    pub(super) fn seat(self: &Arc<Self>) -> Option<Seat> {
        let mut state = self.state();
        if state.viewers.len() >= MAX_VIEWERS {
            return None;
        }
        state.last_viewer += 1;
        let viewer = state.last_viewer;
        state.viewers.insert(viewer, None);
        Some(Seat { hub: Arc::clone(self), viewer, seen: None })
    }

    /// Returns the state, even after a panic of another thread: lines are added one at a time, so it is consistent.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Drops the events of the previous node.
    fn forget(&mut self) {
        self.description = None;
        self.mode = None;
        self.snapshot = None;
        self.absent = None;
    }

    fn push(&mut self, event: Event) {
        if self.recent.len() == MAX_RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(event);
    }

    /// Returns the events after `seen`: all of them, or for a new or slow viewer the newest of each kind.
    fn after(&self, seen: Option<u64>) -> Vec<Event> {
        let oldest = self.recent.front().map_or(0, |event| event.number);
        match seen {
            Some(seen) if seen + 1 >= oldest => {
                self.recent.iter().filter(|event| event.number > seen).cloned().collect()
            }
            _ => {
                let kept = [&self.description, &self.mode, &self.snapshot, &self.absent];
                let is_new = |event: &&Event| seen.is_none_or(|seen| event.number > seen);
                let mut events: Vec<Event> =
                    kept.into_iter().flatten().filter(is_new).cloned().collect();
                events.sort_by_key(|event| event.number);
                events
            }
        }
    }
}

impl Seat {
    /// Returns the events since the last call; without any, `waker` is called at the next one.
    pub(super) fn take(&mut self, waker: &Waker) -> VecDeque<Bytes> {
        let mut state = self.hub.state();
        let events = state.after(self.seen);
        if events.is_empty() {
            state.viewers.insert(self.viewer, Some(waker.clone()));
        } else {
            self.seen = Some(state.newest);
        }
        events.into_iter().map(|event| event.text).collect()
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.hub.state().viewers.remove(&self.viewer);
    }
}

fn name(kind: Kind) -> &'static str {
    match kind {
        Kind::Description => "description",
        Kind::Mode => "mode",
        Kind::Snapshot => "snapshot",
        Kind::Other => "other",
    }
}

/// Returns a JSON object as an event. A carriage return between its parts would end the event.
fn event(name: &str, json: &str) -> Bytes {
    format!("event: {name}\ndata: {}\n\n", json.replace('\r', " ")).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feed::Line;

    fn line(kind: Kind, text: &str) -> News {
        News::Line(Line { kind, text: text.into() })
    }

    fn taken(seat: &mut Seat) -> Vec<String> {
        let events = seat.take(Waker::noop());
        events.iter().map(|text| String::from_utf8(text.to_vec()).unwrap()).collect()
    }

    #[test]
    fn slow_viewer_gets_the_newest_of_each_kind() {
        let hub = Arc::new(Hub::default());
        let (mut fast, mut slow) = (hub.seat().unwrap(), hub.seat().unwrap());
        hub.publish(&line(Kind::Description, "{}"));
        hub.publish(&line(Kind::Mode, "{\"mode\":\"boot\"}"));
        assert_eq!(taken(&mut fast).len(), 2);
        assert_eq!(taken(&mut slow).len(), 2);
        hub.publish(&line(Kind::Mode, "{\"mode\":\"ready\"}"));
        for cycle in 0..100 {
            hub.publish(&line(Kind::Snapshot, &format!("{{\"cycle\":{cycle}}}")));
            assert!(taken(&mut fast).last().unwrap().contains(&format!("{cycle}}}")));
        }
        let found = taken(&mut slow);
        let expected = [
            "event: mode\ndata: {\"mode\":\"ready\"}\n\n",
            "event: snapshot\ndata: {\"cycle\":99}\n\n",
        ];
        assert_eq!(found, expected);
        assert!(taken(&mut slow).is_empty());
        assert!(hub.state().recent.len() <= MAX_RECENT);
    }

    #[test]
    fn late_viewer_gets_nothing_of_a_node_that_has_ended() {
        let hub = Arc::new(Hub::default());
        hub.publish(&line(Kind::Description, "{}"));
        hub.publish(&line(Kind::Mode, "{}"));
        hub.publish(&News::Absent("a \"b\"\n<c>".to_owned()));
        let found = taken(&mut hub.seat().unwrap());
        assert_eq!(found, ["event: absent\ndata: {\"reason\":\"a \\\"b\\\"\\n<c>\"}\n\n"]);
        hub.publish(&line(Kind::Description, "{\r\"a\":1}"));
        assert_eq!(taken(&mut hub.seat().unwrap()), ["event: description\ndata: { \"a\":1}\n\n"]);
    }

    #[test]
    fn dropped_seat_makes_room() {
        let hub = Arc::new(Hub::default());
        let mut seats: Vec<Seat> = (0..MAX_VIEWERS).map(|_| hub.seat().unwrap()).collect();
        assert!(hub.seat().is_none());
        seats.pop();
        assert!(hub.seat().is_some());
    }
}
