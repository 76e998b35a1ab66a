//! Tests of both ends against a model that stores every number: in any schedule, accepted messages take effect once, in
//! order and in time.

use std::collections::{BTreeSet, HashSet};

use proptest::prelude::*;

use super::{Ends, HOLD_AFTER, OFFSET, UnderWay, at, rate, send};
use crate::head::{Echo, Head};
use crate::peers::Peers;
use crate::{Command, Feedback, Motion, Reason, Reject, Rejects};
use units::time::Instant;

/// Reference model of one end: the set of all numbers received, and its own send times by number.
struct Model {
    received: BTreeSet<u64>,
    sent: Vec<Instant>,
}

impl Model {
    /// Returns the model of an end of [`Ends::armed`]: four messages sent and received at 0 to 3 ms, on its own clock.
    fn armed(clock: impl Fn(u64) -> Instant) -> Self {
        Self { received: (1..=4).collect(), sent: (0..4).map(clock).collect() }
    }

    /// Returns the send time of the echoed message if a message is accepted at `now`, or the reason of its rejection.
    fn verdict(&mut self, now: Instant, head: &Head) -> Result<Instant, Reject> {
        let (number, newest) = (head.own.sequence, *self.received.last().unwrap());
        let is_behind = newest.saturating_sub(number) >= 128;
        if is_behind || !self.received.insert(number) {
            return Err(Reject::Replayed);
        }
        if number < newest {
            return Err(Reject::Overtaken);
        }
        let echoed = usize::try_from(head.echo.sequence).unwrap() - 1;
        let sent_at = self.sent[echoed];
        if now.since(sent_at) <= HOLD_AFTER { Ok(sent_at) } else { Err(Reject::Old) }
    }
}

/// Reference model of the numbers of a session: the set of all received ones after the first.
struct Numbers {
    first: u64,
    newest: u64,
    received: HashSet<u64>,
}

impl Numbers {
    fn take(&mut self, number: u64) -> Result<(), Reject> {
        let is_behind = self.newest >= number && self.newest - number >= 128;
        if number <= self.first || is_behind || !self.received.insert(number) {
            return Err(Reject::Replayed);
        }
        let is_newest = number > self.newest;
        self.newest = self.newest.max(number);
        if is_newest { Ok(()) } else { Err(Reject::Overtaken) }
    }

    fn lost(&self) -> u64 {
        self.newest - self.first - u64::try_from(self.received.len()).unwrap()
    }
}

/// Generates increments of a number: mostly small, some across the window, few to the end of the range.
fn steps() -> impl Strategy<Value = Vec<i64>> {
    let step = prop_oneof![
        8 => -10..10_i64,
        4 => -150..150_i64,
        1 => -100_000..100_000_i64,
        1 => Just(i64::MAX),
    ];
    prop::collection::vec(step, 1..400)
}

/// Returns the reason whose count differs between two counts.
fn counted(before: &Rejects, after: &Rejects) -> Option<Reject> {
    after.iter().find(|(reason, count)| before.get(*reason) != *count).map(|(reason, _)| reason)
}

proptest! {
    #[test]
    fn property_12_received_numbers_match_a_set_of_all(
        first in prop_oneof![1..5_000_u64, 1..u64::MAX], steps in steps(),
    ) {
        let (mut peers, now) = (Peers::new(HOLD_AFTER), at(0));
        let mut admit = |number| {
            let message = Echo { session: 22, sequence: number };
            let verdict = peers.admit(now, message, Echo { session: 11, sequence: 1 }, Ok(now));
            (verdict.map(|_| ()), peers.lost(), peers.echo().sequence)
        };
        prop_assert_eq!(admit(first), (Ok(()), 0, first));
        let mut numbers = Numbers { first, newest: first, received: HashSet::new() };
        let mut number = first;
        for step in steps {
            number = number.saturating_add_signed(step).max(1);
            let verdict = numbers.take(number);
            prop_assert_eq!(admit(number), (verdict, numbers.lost(), numbers.newest), "{}", number);
        }
    }

    #[test]
    fn hazard_36_any_schedule_acts_once_in_order_and_in_time(
        fates in prop::collection::vec(prop::array::uniform3(0..220_u64), 200),
    ) {
        let mut ends = Ends::armed();
        let (mut far_model, mut node_model) = (Model::armed(|ms| at(ms) + OFFSET), Model::armed(at));
        let (mut there, mut back) = (UnderWay::new(), UnderWay::new());
        let mut fates = fates.into_iter().cycle();
        let (mut newest, mut acted) = (None, [0_u64; 2]);
        for ms in 4..600 {
            let (now, fars) = (at(ms), at(ms) + OFFSET);
            send(&mut there, ms, &ends.command(now, rate(now)), fates.next().unwrap());
            node_model.sent.push(now);
            for message in there.remove(&ms).unwrap_or_default() {
                let command = Command::decode(&message).unwrap();
                let before = *ends.far.rejects();
                ends.far.on_message(fars, &message);
                let verdict = far_model.verdict(fars, &command.head);
                prop_assert_eq!(counted(&before, ends.far.rejects()), verdict.err());
                if let Ok(at) = verdict {
                    prop_assert!(command.head.own.sequence > acted[0]);
                    acted[0] = command.head.own.sequence;
                    newest = Some((at, command.motion));
                }
            }
            let performed = ends.far.motion(fars);
            let fresh = newest.filter(|(at, _)| fars.since(*at) <= HOLD_AFTER);
            let follows = fresh.filter(|_| ends.far.reason() == Reason::None);
            prop_assert_eq!(performed, follows.map_or(Motion::Hold, |(_, motion)| motion));
            send(&mut back, ms, &ends.feedback(now), fates.next().unwrap());
            far_model.sent.push(fars);
            for message in back.remove(&ms).unwrap_or_default() {
                let head = Feedback::decode(&message).unwrap().head;
                let sample = ends.node.on_message(now, &message);
                let verdict = node_model.verdict(now, &head);
                prop_assert_eq!((sample.map(|one| one.at), ends.node.rejected()), (verdict.ok(), verdict.err()));
                if verdict.is_ok() {
                    prop_assert!(head.own.sequence > acted[1]);
                    acted[1] = head.own.sequence;
                }
            }
            if ms % 97 == 0 {
                ends.node.begin_epoch();
            }
        }
    }

    #[test]
    fn property_13_stale_message_stays_stale_at_both_ends(
        age in 0..200_000_u64, more in 0..200_000_u64,
    ) {
        let after = |micros: u64| at(4) + std::time::Duration::from_micros(micros);
        let mut ends = Ends::armed();
        // The command echoes a feedback of 3 ms; the feedback echoes a command of 3 ms.
        let (command, feedback) = (ends.command(at(4), rate(at(4))), ends.feedback(at(4)));
        let acts = |micros: u64| {
            let (mut far, mut node) = (ends.far.clone(), ends.node.clone());
            far.on_message(after(micros) + OFFSET, &command);
            let is_followed = far.motion(after(micros) + OFFSET) == rate(at(4));
            [is_followed, node.on_message(after(micros), &feedback).is_some()]
        };
        prop_assert_eq!(acts(age), [age <= 99_000; 2]);
        for (now, later) in acts(age).into_iter().zip(acts(age + more)) {
            prop_assert!(now || !later);
        }
    }
}

#[test]
fn hazard_35_new_messages_with_an_old_echo_stay_stale() {
    // From 4 ms on neither end receives, but each sends for more than one wrap of its ring of send times.
    let [mut deaf_far, mut deaf_node] = [Ends::armed(), Ends::armed()];
    for ms in 4..12_000 {
        deaf_far.command(at(ms), Motion::Hold);
        let feedback = deaf_far.feedback(at(ms));
        let sample = deaf_far.node.on_message(at(ms), &feedback);
        assert_eq!(sample.map(|sample| sample.at), (ms <= 103).then(|| at(3)), "{ms} ms");

        deaf_node.feedback(at(ms));
        let command = deaf_node.command(at(ms), rate(at(ms)));
        deaf_node.far.on_message(at(ms) + OFFSET, &command);
        let performed = deaf_node.far.motion(at(ms) + OFFSET);
        assert_eq!(performed, if ms <= 103 { rate(at(ms)) } else { Motion::Hold }, "{ms} ms");
        if ms % 500 == 0 {
            // A new epoch does not make it fresh.
            deaf_node.node.begin_epoch();
        }
    }
    for rejects in [deaf_far.node.rejects(), deaf_node.far.rejects()] {
        assert_eq!(rejects.iter().collect::<Vec<_>>(), [(Reject::Old, 12_000 - 104)]);
    }
    assert_eq!(deaf_node.far.reason(), Reason::Silence);
}
