//! Newest lines of the node, as they were sent.

use serde_json::Value;

use super::value::{at, list, nth, number, text};
use crate::feed::{Kind, Line, News};

/// Time for which the greatest value of a watchdog is shown, in µs.
const PEAK_HOLD_US: f64 = 1_000_000.0;

/// Age from which a snapshot is marked as old, in µs: a boot sends none.
const MAX_SNAPSHOT_AGE_US: f64 = 1_000_000.0;

/// State of the node, as far as it was received.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// Newest description.
    pub(super) description: Value,
    /// Newest mode.
    pub(super) mode: Value,
    /// Newest snapshot.
    pub(super) snapshot: Value,
    /// Reason why there is no node.
    pub(super) absence: Option<String>,
    /// Number of lines received.
    pub(super) received: u64,
    /// Greatest values of the watchdogs, in their order.
    pub(super) watchdogs: Vec<Watchdog>,
    /// Set if the snapshot is newer than the mode.
    is_snapshot_newest: bool,
}

/// Watchdog, and its greatest value within the last second.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Watchdog {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) value: Option<f64>,
    pub(super) limit: Option<f64>,
    /// Time of the value, in µs.
    at_us: Option<f64>,
}

impl State {
    /// Takes a line, or the reason why there is no node.
    pub(super) fn on_news(&mut self, news: News) {
        match news {
            News::Line(line) => self.on_line(&line),
            News::Absent(reason) => self.absence = text(&Value::String(reason)),
        }
    }

    fn on_line(&mut self, line: &Line) {
        // A line that is not JSON counts as one of an unknown kind.
        let Ok(value) = serde_json::from_str::<Value>(&line.text) else { return };
        self.received = self.received.wrapping_add(1);
        self.absence = None;
        match line.kind {
            Kind::Description => {
                // Another connection: the values of the previous node are dropped.
                *self = Self { description: value, received: self.received, ..Self::default() };
            }
            Kind::Mode => {
                self.mode = value;
                self.is_snapshot_newest = false;
            }
            Kind::Snapshot => {
                self.watchdogs = self.peaks(&value);
                self.snapshot = value;
                self.is_snapshot_newest = true;
            }
            Kind::Other => {}
        }
    }

    /// Returns the watchdogs of a snapshot, with a value of the last second where that was greater.
    fn peaks(&self, snapshot: &Value) -> Vec<Watchdog> {
        let at_us = number(at(snapshot, &["at_us"]));
        let named = |value: &Value, key| text(at(value, &[key])).unwrap_or_default();
        let watchdog = |value: &Value| {
            let new = Watchdog {
                name: named(value, "name"),
                unit: named(value, "unit"),
                value: number(at(value, &["value"])),
                limit: number(at(value, &["limit"])),
                at_us,
            };
            let before = self.watchdogs.iter().find(|watchdog| watchdog.name == new.name);
            let kept = before.filter(|before| before.outlasts(&new));
            kept.map_or(new.clone(), |before| Watchdog { limit: new.limit, ..before.clone() })
        };
        list(at(snapshot, &["watchdogs"])).iter().map(watchdog).collect()
    }

    /// Returns the newest line with the mode.
    fn newest(&self) -> &Value {
        if self.is_snapshot_newest { &self.snapshot } else { &self.mode }
    }

    /// Returns the mode; empty before the first line with it.
    pub(super) fn mode_name(&self) -> String {
        text(at(self.newest(), &["mode"])).unwrap_or_default()
    }

    /// Returns the cause of the stop, while stopped.
    pub(super) fn cause(&self) -> Option<String> {
        text(at(self.newest(), &["stopped_by"]))
    }

    /// Returns the names of the joints whose drives do not report that they are off.
    pub(super) fn not_off(&self) -> Vec<String> {
        let named = |joint: &Value| {
            let place = joint.as_u64().and_then(|number| usize::try_from(number).ok());
            let by_number = || place?.checked_sub(1).map(|place| self.joint_name(place));
            text(joint).or_else(by_number).unwrap_or_else(|| "a joint without a name".to_owned())
        };
        list(at(self.newest(), &["not_off"])).iter().map(named).collect()
    }

    /// Returns the reason why the zero of a joint is unknown; `None` if it is known.
    pub(super) fn unknown_zero(&self, place: usize) -> Option<String> {
        let unknown = list(at(&self.snapshot, &["zero_unknown"]));
        let number = u64::try_from(place + 1).ok();
        let found = unknown.iter().find(|it| at(it, &["joint"]).as_u64() == number)?;
        Some(text(at(found, &["why"])).unwrap_or_default())
    }

    /// Returns the steps that lead on from this mode.
    pub(super) fn way_out(&self) -> Vec<String> {
        let is_of_mode = text(at(&self.mode, &["mode"])) == Some(self.mode_name());
        let steps = if is_of_mode { list(at(&self.mode, &["way_out"])) } else { &[] };
        steps.iter().filter_map(text).collect()
    }

    /// Returns the name of the joint at this place, from 0 at the base.
    pub(super) fn joint_name(&self, place: usize) -> String {
        let name = text(at(self.joint(place), &["name"]));
        name.unwrap_or_else(|| format!("joint {}", place + 1))
    }

    /// Returns the description of the joint at this place.
    pub(super) fn joint(&self, place: usize) -> &Value {
        nth(at(&self.description, &["hand", "joints"]), place)
    }

    /// Returns the time of the newest line that has one, in µs.
    pub(super) fn at_us(&self) -> Option<f64> {
        number(at(self.newest(), &["at_us"]))
    }

    /// Returns the cycle of the newest line that has one.
    pub(super) fn cycle(&self) -> Option<f64> {
        number(at(self.newest(), &["cycle"]))
    }

    /// Returns the age of the values in s where they are old, although the node sends its mode.
    pub(super) fn age_of_values(&self) -> Option<f64> {
        let age_us = self.at_us()? - number(at(&self.snapshot, &["at_us"]))?;
        (age_us > MAX_SNAPSHOT_AGE_US).then_some(age_us / 1e6)
    }
}

impl Watchdog {
    /// Returns the share of its limit, 0 to 1.
    pub(super) fn share(&self) -> Option<f64> {
        let (value, limit) = (self.value?, self.limit?);
        (limit > 0.0).then_some(value / limit)
    }

    /// Returns whether this value stays on the screen when `new` arrives.
    fn outlasts(&self, new: &Self) -> bool {
        let age = new.at_us.zip(self.at_us).map(|(new, old)| new - old);
        let is_young = age.is_some_and(|age| (0.0..PEAK_HOLD_US).contains(&age));
        is_young && self.value > new.value
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::number::percent;
    use super::*;

    fn receive(state: &mut State, kind: Kind, value: &Value) {
        state.on_news(News::Line(Line { kind, text: value.to_string().into() }));
    }

    #[test]
    fn newest_line_decides_the_mode() {
        let mut state = State::default();
        receive(
            &mut state,
            Kind::Mode,
            &json!({ "mode": "ready", "way_out": ["arm"], "at_us": 5 }),
        );
        assert_eq!(
            (state.mode_name(), state.way_out()),
            ("ready".to_owned(), vec!["arm".to_owned()])
        );
        receive(
            &mut state,
            Kind::Snapshot,
            &json!({ "mode": "drives-off", "stopped_by": "x", "at_us": 6 }),
        );
        assert_eq!(
            (state.mode_name(), state.cause()),
            ("drives-off".to_owned(), Some("x".to_owned()))
        );
        assert!(state.way_out().is_empty(), "the step led out of another mode");
        receive(&mut state, Kind::Mode, &json!({ "mode": "boot", "at_us": 3_000_006 }));
        assert_eq!((state.mode_name(), state.age_of_values()), ("boot".to_owned(), Some(3.0)));
    }

    #[test]
    fn another_connection_forgets_the_node_before() {
        let mut state = State::default();
        receive(&mut state, Kind::Mode, &json!({ "mode": "engaged" }));
        receive(&mut state, Kind::Snapshot, &json!({ "cycle": 9, "watchdogs": [{ "name": "a" }] }));
        state.on_news(News::Absent("the node has ended.".to_owned()));
        assert!(state.absence.is_some() && state.cycle() == Some(9.0));
        receive(&mut state, Kind::Description, &json!({ "program": "frhc 2" }));
        assert_eq!((state.mode_name(), state.cycle(), state.absence), (String::new(), None, None));
        assert!(state.watchdogs.is_empty());
    }

    #[test]
    fn greatest_value_of_a_watchdog_is_held_for_a_second() {
        let mut state = State::default();
        let mut shown = |at_us: u64, value: f64| {
            let watchdog =
                json!({ "name": "lateness", "value": value, "limit": 10.0, "unit": "µs" });
            receive(
                &mut state,
                Kind::Snapshot,
                &json!({ "at_us": at_us, "watchdogs": [watchdog] }),
            );
            percent(state.watchdogs.first().unwrap().share())
        };
        assert_eq!(
            [shown(0, 5.0), shown(20_000, 1.0), shown(40_000, 6.0)],
            [" 50 %", " 50 %", " 60 %"]
        );
        assert_eq!([shown(1_039_999, 2.0), shown(1_040_000, 2.0)], [" 60 %", " 20 %"]);
        assert_eq!(shown(7, 1.0), " 10 %", "time began anew");
    }

    #[test]
    fn numbers_of_joints_become_names() {
        let mut state = State::default();
        let joints = json!([{ "name": "azimuth" }, { "name": "elevation" }]);
        receive(&mut state, Kind::Description, &json!({ "hand": { "joints": joints } }));
        receive(&mut state, Kind::Mode, &json!({ "not_off": [2, "elbow", 3, 0, null] }));
        let unnamed = "a joint without a name";
        assert_eq!(state.not_off(), ["elevation", "elbow", "joint 3", unnamed, unnamed]);
    }
}
