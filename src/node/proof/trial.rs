//! One trial: a frame of the master stays away, and every drive that waits for it must take its own power
//! off.
//!
//! ```text
//!  last frame      timer says              grace                        no answer is waited for
//!      ├──────────────┼──────────────────────┼───────────────────────────────┤
//!      │ emergency, statusword: heard        │                               │
//!      │              └ 6041h is asked for, again and again, as the last word│
//! ```
//!
//! An emergency tells *when*, only a statusword without power tells *that*: a drive may cry and go on. A
//! pure machine: what is heard comes in, whom to ask and whether it is over come out.

use std::time::Duration;

use crate::power;
use crate::proof::report::NoTrip;
use crate::proof::report::Trip;
use canopen::drive::Statusword;
use canopen::watchdog::Awaited;
use canopen::watchdog::Watchdog;
use units::numbering::Joint;
use units::time::Instant;

/// A drive that does not stop so long after its timer says goes on.
const GRACE: Duration = Duration::from_millis(35);
/// So long after that an answer that is on its way is waited for: some drives serve SDO in their idle time.
const ANSWER: Duration = Duration::from_millis(200);
/// How soon a drive is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(2);

/// The trial of one timer on all drives.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    awaited: Awaited,
    begun: Instant,
    drives: [Option<Subject>; 6],
}

/// One drive that has the timer.
#[derive(Clone, Copy, Debug)]
struct Subject {
    said: Watchdog,
    /// When it said for the first time that something is wrong.
    cried: Option<Instant>,
    /// When it was known for the first time that its power is off.
    off: Option<Instant>,
    question: Question,
}

/// How far the asking is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Question {
    /// To be asked then.
    Due(Instant),
    /// Asked, not answered.
    Open,
    /// The last answer, which came after the grace, was that it goes on.
    Settled,
}

impl Trial {
    /// Begins with the last frame, at `begun`, for the drives that have a timer for it.
    pub(crate) fn new(awaited: Awaited, begun: Instant, timers: [Option<Watchdog>; 6]) -> Self {
        let subject = |said: Watchdog| {
            let question = Question::Due(begun + span(said));
            Subject { said, cried: None, off: None, question }
        };
        Self { awaited, begun, drives: timers.map(|timer| timer.map(subject)) }
    }

    /// What stays away.
    pub(crate) const fn awaited(&self) -> Awaited {
        self.awaited
    }

    /// A joint's drive says that something is wrong.
    pub(crate) fn on_emergency(&mut self, at: Instant, joint: Joint) {
        if let Some(subject) = joint.entry_mut(&mut self.drives) {
            subject.cried.get_or_insert(at);
        }
    }

    /// Whether a drive has said that something is wrong.
    pub(crate) fn has_cried(&self, joint: Joint) -> bool {
        joint.entry(&self.drives).is_some_and(|drive| drive.cried.is_some())
    }

    /// A drive tells by itself what its power stage is in.
    pub(crate) fn on_statusword(&mut self, at: Instant, joint: Joint, word: Statusword) {
        if let Some(subject) = joint.entry_mut(&mut self.drives)
            && !power::may_push(word)
        {
            subject.off.get_or_insert(at);
        }
    }

    /// A drive answers what its power stage is in.
    pub(crate) fn on_answer(&mut self, at: Instant, joint: Joint, word: Statusword) {
        self.on_statusword(at, joint, word);
        let begun = self.begun;
        if let Some(subject) = joint.entry_mut(&mut self.drives) {
            let is_last = at >= begun + span(subject.said) + GRACE;
            subject.question =
                if is_last { Question::Settled } else { Question::Due(at + ASK_AGAIN) };
        }
    }

    /// The next drive to be asked now, if one is.
    pub(crate) fn asks(&mut self, now: Instant) -> Option<Joint> {
        let mut drives = Joint::each(&mut self.drives);
        drives.find_map(|(joint, drive)| {
            let subject = drive.as_mut().filter(|subject| subject.off.is_none())?;
            let Question::Due(at) = subject.question else { return None };
            (at <= now).then(|| {
                subject.question = Question::Open;
                joint
            })
        })
    }

    /// When something is to be done, at the latest; `None` once it is over.
    pub(crate) fn deadline(&self, now: Instant) -> Option<Instant> {
        self.open(now)
            .map(|subject| match subject.question {
                Question::Due(at) => at,
                Question::Open | Question::Settled => self.end(subject),
            })
            .min()
    }

    /// How each drive did that has the timer.
    pub(crate) fn outcome(&self) -> [Option<Result<Trip, NoTrip>>; 6] {
        self.drives.map(|drive| drive.map(|subject| self.verdict(&subject)))
    }

    fn verdict(&self, subject: &Subject) -> Result<Trip, NoTrip> {
        let said = subject.said;
        let Some(off) = subject.off else {
            return Err(NoTrip::KeptPower { said, lasted: span(said) + GRACE });
        };
        let first = subject.cried.map_or(off, |cried| cried.min(off));
        Ok(Trip { said, measured: first.since(self.begun) })
    }

    /// Those that are still waited for.
    fn open(&self, now: Instant) -> impl Iterator<Item = &Subject> {
        self.drives.iter().flatten().filter(move |subject| {
            let is_settled = subject.question == Question::Settled || now >= self.end(subject);
            subject.off.is_none() && !is_settled
        })
    }

    fn end(&self, subject: &Subject) -> Instant {
        self.begun + span(subject.said) + GRACE + ANSWER
    }
}

fn span(said: Watchdog) -> Duration {
    Duration::from_millis(u64::from(said.millis))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::object::Object;

    const FIRST: Joint = Joint::of::<1>();
    const FAULT: Statusword = Statusword(0x0208);
    const ENABLED: Statusword = Statusword(0x0237);

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn timer(millis: u16) -> Option<Watchdog> {
        let object = Object::rpdo_communication(1, 5);
        Some(Watchdog { awaited: Awaited::Rpdo, object, millis })
    }

    /// The first drive has a timer of 5 ms, the others none.
    fn one() -> Trial {
        Trial::new(Awaited::Rpdo, at(0), [timer(5), None, None, None, None, None])
    }

    fn outcome(trial: &Trial) -> Result<u128, NoTrip> {
        trial.outcome()[0].unwrap().map(|trip| trip.measured.as_micros())
    }

    #[test]
    fn an_emergency_says_when_and_only_a_statusword_says_that() {
        let mut trial = one();
        trial.on_emergency(at(5_300), FIRST);
        assert_eq!(trial.deadline(at(5_400)), Some(at(5_000)), "not over yet");
        trial.on_statusword(at(6_100), FIRST, FAULT);
        assert_eq!(trial.deadline(at(6_200)), None);
        assert_eq!(outcome(&trial), Ok(5_300));
    }

    #[test]
    fn a_drive_that_cries_and_goes_on_is_asked_until_the_grace_is_over() {
        let mut trial = one();
        trial.on_emergency(at(5_300), FIRST);
        let mut now = at(0);
        let mut asked = 0;
        while let Some(due) = trial.deadline(now) {
            now = now.max(due);
            if trial.asks(now) == Some(FIRST) {
                asked += 1;
                trial.on_answer(now, FIRST, ENABLED);
            }
        }
        assert_eq!((asked, now), (19, at(41_000)), "from 5 ms on, every 2 ms");
        let lasted = Duration::from_millis(40);
        assert_eq!(outcome(&trial), Err(NoTrip::KeptPower { said: timer(5).unwrap(), lasted }));
    }

    #[test]
    fn one_that_never_answers_is_not_waited_for_for_ever() {
        let mut trial = one();
        assert_eq!(trial.asks(at(4_999)), None, "not before its timer says");
        assert_eq!(trial.asks(at(5_000)), Some(FIRST));
        assert_eq!(trial.asks(at(5_000)), None, "one question at a time");
        assert_eq!(trial.deadline(at(5_000)), Some(at(240_000)));
        assert_eq!(trial.deadline(at(240_000)), None);
        assert!(outcome(&trial).is_err());
    }

    #[test]
    fn a_slow_answer_to_an_early_question_still_counts() {
        let mut trial = one();
        assert_eq!(trial.asks(at(5_000)), Some(FIRST));
        trial.on_answer(at(155_000), FIRST, FAULT);
        assert_eq!(outcome(&trial), Ok(155_000));
    }

    #[test]
    fn a_drive_whose_stop_takes_its_time_still_pushes() {
        let mut trial = one();
        trial.on_statusword(at(5_300), FIRST, Statusword(0x021F));
        assert!(outcome(&trial).is_err(), "fault reaction active");
        trial.on_statusword(at(9_300), FIRST, FAULT);
        assert_eq!(outcome(&trial), Ok(9_300));
    }

    proptest! {
        #[test]
        fn whatever_is_heard_it_ends_and_only_a_drive_without_power_has_tripped(
            told in proptest::collection::vec((0_u64..300_000, 0_usize..6, any::<u16>(), 0..3), 0..50),
        ) {
            let mut trial = Trial::new(Awaited::Rpdo, at(0), [timer(5); 6]);
            let mut off = [false; 6];
            for (micros, drive, word, kind) in told {
                let (joint, word) = (Joint::at(drive).unwrap(), Statusword(word));
                match kind {
                    0 => trial.on_emergency(at(micros), joint),
                    1 => trial.on_statusword(at(micros), joint, word),
                    _ => trial.on_answer(at(micros), joint, word),
                }
                if kind > 0 && !power::may_push(word) {
                    off[drive] = true;
                }
            }
            let tripped = trial.outcome().map(|outcome| outcome.unwrap().is_ok());
            prop_assert_eq!(tripped, off);
            prop_assert_eq!(trial.deadline(at(240_000)), None);
        }
    }
}
