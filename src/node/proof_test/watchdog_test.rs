//! Test of one watchdog on all drives. A frame of the master is withheld, and every drive that awaits it must switch its
//! power stage off.
//!
//! ```text
//!  last frame    watchdog time          grace time              answer timeout
//!      ├──────────────┼──────────────────────┼───────────────────────────────┤
//!      │ emergencies and statuswords arrive  │                               │
//!      │              └ 6041h is read by SDO every 2 ms                      │
//! ```
//!
//! An EMCY message gives the time of the expiry. Only a statusword confirms it, because a drive may report a fault and stay
//! enabled. The test does no input or output: received data goes in, the next statusword to read comes out.
//!
//! A drive passes by a statusword that was sent in the grace time, or requested in it and answered within the answer timeout.
//! It fails by one that was requested after the grace time and shows power on. Where a lost or late answer leaves neither,
//! nothing is shown. The test ends after the last answer, which cannot be confused with one of a later test.

use std::time::Duration;

use crate::power;
use crate::proof_test::report::{NoExpiry, WatchdogExpiry};
use canopen::drive::Statusword;
use canopen::master::STATUSWORD_TIMEOUT;
use canopen::watchdog::{LifeSign, Watchdog};
use units::numbering::Joint;
use units::time::Instant;

/// Maximum time after the watchdog time until the power stage is off.
const GRACE_TIME: Duration = Duration::from_millis(35);
/// Maximum time after that until the last SDO answer: some drives serve SDO in their idle time.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(200);
/// Time between two readings of the statusword.
const READ_INTERVAL: Duration = Duration::from_millis(2);

/// Test of one watchdog on all drives.
#[derive(Clone, Debug)]
pub(crate) struct WatchdogTest {
    awaited: LifeSign,
    started_at: Instant,
    drives: [Option<DriveTest>; 6],
}

/// Test of one drive that has the watchdog.
#[derive(Clone, Copy, Debug)]
struct DriveTest {
    watchdog: Watchdog,
    /// Maximum time until the node detects the expiry, by the plan.
    planned: Duration,
    /// Time of its first emergency.
    reported_at: Option<Instant>,
    /// Time of the first statusword that shows in time that the power stage is off.
    off_at: Option<Instant>,
    read: StatuswordRead,
}

/// State of reading a drive's statusword by SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StatuswordRead {
    /// To be read at this time.
    Due(Instant),
    /// Requested at this time, not answered yet.
    Pending(Instant),
    /// Requested after the grace time, and power was on.
    KeptPower,
    /// Power was off in a statusword that came too late: not read again.
    TooLate,
}

impl WatchdogTest {
    /// Starts the test of these watchdogs, each with the maximum time until the node detects its expiry, by the plan. The
    /// last frame was sent at `started_at`.
    pub(crate) fn new(
        awaited: LifeSign,
        started_at: Instant,
        watchdogs: [Option<(Watchdog, Duration)>; 6],
    ) -> Self {
        let drive_test = |(watchdog, planned): (Watchdog, Duration)| {
            let read = StatuswordRead::Due(started_at + timeout(watchdog));
            DriveTest { watchdog, planned, reported_at: None, off_at: None, read }
        };
        Self { awaited, started_at, drives: watchdogs.map(|watchdog| watchdog.map(drive_test)) }
    }

    /// Returns the withheld frame.
    pub(crate) const fn awaited(&self) -> LifeSign {
        self.awaited
    }

    /// Takes an emergency of a drive's watchdog.
    pub(crate) fn on_emergency(&mut self, at: Instant, joint: Joint) {
        if let Some(drive) = joint.entry_mut(&mut self.drives) {
            drive.reported_at.get_or_insert(at);
        }
    }

    /// Returns whether a drive has sent an emergency of its watchdog.
    pub(crate) fn has_reported(&self, joint: Joint) -> bool {
        joint.entry(&self.drives).is_some_and(|drive| drive.reported_at.is_some())
    }

    /// Takes a statusword from a TPDO.
    pub(crate) fn on_statusword(&mut self, at: Instant, joint: Joint, word: Statusword) {
        let started_at = self.started_at;
        if let Some(drive) = joint.entry_mut(&mut self.drives)
            && !power::may_apply_torque(word)
        {
            drive.on_power_off(at, at <= grace_end(started_at, drive.watchdog));
        }
    }

    /// Takes a statusword read by SDO; ignores one that this test has not requested.
    pub(crate) fn on_sdo_answer(&mut self, at: Instant, joint: Joint, word: Statusword) {
        let started_at = self.started_at;
        let Some(drive) = joint.entry_mut(&mut self.drives) else { return };
        let StatuswordRead::Pending(requested_at) = drive.read else { return };
        let grace_end = grace_end(started_at, drive.watchdog);
        let is_early = requested_at <= grace_end;
        drive.read = if is_early || !power::may_apply_torque(word) {
            StatuswordRead::Due(at + READ_INTERVAL)
        } else {
            StatuswordRead::KeptPower
        };
        if !power::may_apply_torque(word) {
            drive.on_power_off(at, is_early && at <= grace_end + ANSWER_TIMEOUT);
        }
    }

    /// Returns the next drive whose statusword must be read now. It is due again later, unless it is then
    /// [requested](Self::on_requested).
    pub(crate) fn next_to_read(&mut self, now: Instant) -> Option<Joint> {
        let mut drives = Joint::each(&mut self.drives);
        drives.find_map(|(joint, tested)| {
            let drive = tested.as_mut().filter(|drive| drive.off_at.is_none())?;
            let StatuswordRead::Due(at) = drive.read else { return None };
            (at <= now).then(|| {
                drive.read = StatuswordRead::Due(now + READ_INTERVAL);
                joint
            })
        })
    }

    /// Records that the statusword of this drive is requested now.
    pub(crate) fn on_requested(&mut self, now: Instant, joint: Joint) {
        if let Some(drive) = joint.entry_mut(&mut self.drives) {
            drive.read = StatuswordRead::Pending(now);
        }
    }

    /// Returns the time of the next reading or timeout; `None` once the test has ended.
    pub(crate) fn deadline(&self, now: Instant) -> Option<Instant> {
        self.pending(now)
            .map(|drive| match drive.read {
                StatuswordRead::Due(at) => at,
                StatuswordRead::Pending(_)
                | StatuswordRead::KeptPower
                | StatuswordRead::TooLate => self.end(drive),
            })
            .min()
    }

    /// Returns the result of each drive that has the watchdog.
    pub(crate) fn outcome(&self) -> [Option<Result<WatchdogExpiry, NoExpiry>>; 6] {
        self.drives.map(|drive| drive.map(|drive| self.verdict(&drive)))
    }

    fn verdict(&self, drive: &DriveTest) -> Result<WatchdogExpiry, NoExpiry> {
        let watchdog = drive.watchdog;
        let since_start = |at: Instant| at.since(self.started_at);
        match (drive.off_at, drive.read) {
            (Some(off_at), _) => {
                let first = drive.reported_at.map_or(off_at, |reported_at| reported_at.min(off_at));
                let planned = drive.planned;
                Ok(WatchdogExpiry { watchdog, measured: since_start(first), planned })
            }
            (None, StatuswordRead::KeptPower) => {
                Err(NoExpiry::KeptPower { watchdog, duration: timeout(watchdog) + GRACE_TIME })
            }
            (
                None,
                StatuswordRead::Due(_) | StatuswordRead::Pending(_) | StatuswordRead::TooLate,
            ) => {
                Err(NoExpiry::Unanswered { watchdog, reported: drive.reported_at.map(since_start) })
            }
        }
    }

    /// Returns the drives without a final result, and those whose statusword is being read.
    fn pending(&self, now: Instant) -> impl Iterator<Item = &DriveTest> {
        self.drives.iter().flatten().filter(move |drive| {
            let is_open = match drive.read {
                StatuswordRead::Due(_) => drive.off_at.is_none(),
                StatuswordRead::Pending(_) => true,
                StatuswordRead::KeptPower | StatuswordRead::TooLate => false,
            };
            is_open && now < self.end(drive)
        })
    }

    /// Returns the end of the pending read, or of the time in which the drive may be read again.
    fn end(&self, drive: &DriveTest) -> Instant {
        let from = match drive.read {
            StatuswordRead::Pending(requested_at) => requested_at,
            StatuswordRead::Due(_) | StatuswordRead::KeptPower | StatuswordRead::TooLate => {
                grace_end(self.started_at, drive.watchdog)
            }
        };
        from + STATUSWORD_TIMEOUT
    }
}

impl DriveTest {
    /// Takes a statusword that shows that the power stage is off.
    fn on_power_off(&mut self, at: Instant, is_in_time: bool) {
        if is_in_time {
            self.off_at.get_or_insert(at);
        } else if !matches!(self.read, StatuswordRead::Pending(_)) && self.off_at.is_none() {
            self.read = StatuswordRead::TooLate;
        }
    }
}

/// Returns the time at which the power stage must be off.
fn grace_end(started_at: Instant, watchdog: Watchdog) -> Instant {
    started_at + timeout(watchdog) + GRACE_TIME
}

fn timeout(watchdog: Watchdog) -> Duration {
    Duration::from_millis(u64::from(watchdog.millis))
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
        Some(Watchdog { awaited: LifeSign::Rpdo, object, millis })
    }

    /// Returns a test of six drives. Only the first has a watchdog, of 5 ms.
    fn one() -> WatchdogTest {
        WatchdogTest::new(LifeSign::Rpdo, at(0), [planned(5), None, None, None, None, None])
    }

    fn planned(millis: u16) -> Option<(Watchdog, Duration)> {
        Some((timer(millis)?, Duration::from_millis(u64::from(millis) + 1)))
    }

    fn outcome(test: &WatchdogTest) -> Result<u128, NoExpiry> {
        test.outcome()[0].unwrap().map(|expiry| expiry.measured.as_micros())
    }

    #[test]
    fn emergency_gives_the_trip_time_and_a_statusword_confirms_it() {
        let mut test = one();
        test.on_emergency(at(5_300), FIRST);
        assert_eq!(test.deadline(at(5_400)), Some(at(5_000)), "not over yet");
        test.on_statusword(at(6_100), FIRST, FAULT);
        assert_eq!(test.deadline(at(6_200)), None);
        assert_eq!(outcome(&test), Ok(5_300));
    }

    #[test]
    fn drive_that_stays_enabled_after_its_emergency_fails() {
        let mut test = one();
        test.on_emergency(at(5_300), FIRST);
        let mut now = at(0);
        let mut readings = 0;
        while let Some(due) = test.deadline(now) {
            now = now.max(due);
            if test.next_to_read(now) == Some(FIRST) {
                readings += 1;
                test.on_requested(now, FIRST);
                test.on_sdo_answer(now, FIRST, ENABLED);
            }
        }
        assert_eq!((readings, now), (19, at(41_000)), "from 5 ms on, every 2 ms");
        let duration = Duration::from_millis(40);
        assert_eq!(
            outcome(&test),
            Err(NoExpiry::KeptPower { watchdog: timer(5).unwrap(), duration })
        );
    }

    /// Requests the statusword of the first drive, which is due.
    fn request(test: &mut WatchdogTest, micros: u64) {
        assert_eq!(test.next_to_read(at(micros)), Some(FIRST));
        test.on_requested(at(micros), FIRST);
    }

    fn unanswered(reported: Option<u64>) -> Result<u128, NoExpiry> {
        let reported = reported.map(Duration::from_micros);
        Err(NoExpiry::Unanswered { watchdog: timer(5).unwrap(), reported })
    }

    #[test]
    fn unanswered_reading_times_out_and_shows_nothing() {
        let mut test = one();
        assert_eq!(test.next_to_read(at(4_999)), None, "not before the watchdog time");
        request(&mut test, 5_000);
        assert_eq!(test.next_to_read(at(7_000)), None, "one reading at a time");
        assert_eq!(test.deadline(at(5_000)), Some(at(1_005_000)));
        assert_eq!(test.deadline(at(1_005_000)), None);
        assert_eq!(outcome(&test), unanswered(None));
        test.on_emergency(at(5_300), FIRST);
        assert_eq!(outcome(&test), unanswered(Some(5_300)));
    }

    #[test]
    fn refused_reading_is_due_again() {
        let mut test = one();
        assert_eq!(test.next_to_read(at(5_000)), Some(FIRST), "and another request is pending");
        assert_eq!(test.next_to_read(at(6_999)), None);
        assert_eq!(test.next_to_read(at(7_000)), Some(FIRST));
    }

    #[test]
    fn slow_answer_to_an_early_reading_counts() {
        let mut test = one();
        request(&mut test, 5_000);
        test.on_sdo_answer(at(155_000), FIRST, FAULT);
        assert_eq!(outcome(&test), Ok(155_000));
    }

    #[test]
    fn answer_after_its_timeout_passes_and_blames_no_drive() {
        for word in [FAULT, ENABLED] {
            let mut test = one();
            request(&mut test, 5_000);
            test.on_sdo_answer(at(405_000), FIRST, word);
            assert_eq!(outcome(&test), unanswered(None), "{word:?}");
            assert_eq!(test.deadline(at(405_000)).is_none(), word == FAULT, "{word:?}");
        }
    }

    #[test]
    fn drive_that_is_off_after_the_grace_time_never_passes() {
        // A late answer hid that it was still on.
        let mut test = one();
        test.on_emergency(at(5_300), FIRST);
        request(&mut test, 5_000);
        test.on_sdo_answer(at(60_000), FIRST, ENABLED);
        request(&mut test, 62_000);
        test.on_sdo_answer(at(62_500), FIRST, FAULT);
        assert_eq!(outcome(&test), unanswered(Some(5_300)), "by SDO");
        // A lost answer hid it, and its TPDO comes.
        let mut test = one();
        request(&mut test, 5_000);
        test.on_statusword(at(40_001), FIRST, FAULT);
        assert_eq!(outcome(&test), unanswered(None), "by TPDO");
        assert_eq!(test.deadline(at(40_001)), Some(at(1_005_000)), "until its answer");
    }

    #[test]
    fn unrequested_statusword_is_ignored() {
        let mut test = one();
        test.on_sdo_answer(at(5_100), FIRST, FAULT);
        assert_eq!(outcome(&test), unanswered(None), "requested by the test before");
    }

    #[test]
    fn test_ends_after_the_answer_of_a_drive_that_is_off() {
        let mut test = one();
        request(&mut test, 5_000);
        test.on_statusword(at(5_300), FIRST, FAULT);
        assert_eq!(test.deadline(at(5_300)), Some(at(1_005_000)));
        test.on_sdo_answer(at(405_000), FIRST, ENABLED);
        assert_eq!((test.deadline(at(405_000)), outcome(&test)), (None, Ok(5_300)));
    }

    #[test]
    fn fault_reaction_active_is_not_off() {
        let mut test = one();
        test.on_statusword(at(5_300), FIRST, Statusword(0x021F));
        assert!(outcome(&test).is_err(), "fault reaction active");
        test.on_statusword(at(9_300), FIRST, FAULT);
        assert_eq!(outcome(&test), Ok(9_300));
    }

    proptest! {
        #[test]
        fn any_input_ends_the_test_and_only_drives_off_in_time_pass(
            inputs in proptest::collection::vec((0_u64..300_000, 0_usize..6, any::<u16>(), 0..3), 0..50),
        ) {
            let mut test = WatchdogTest::new(LifeSign::Rpdo, at(0), [planned(5); 6]);
            let mut off = [false; 6];
            let mut requested = [None; 6];
            for (micros, drive, word, kind) in inputs {
                let (joint, word, grace_end) = (Joint::at(drive).unwrap(), Statusword(word), 40_000);
                let is_in_time = match kind {
                    0 => {
                        test.on_emergency(at(micros), joint);
                        false
                    }
                    1 => {
                        test.on_statusword(at(micros), joint, word);
                        micros <= grace_end
                    }
                    _ => {
                        if let Some(due) = test.next_to_read(at(micros)) {
                            test.on_requested(at(micros), due);
                            requested[due.index()] = Some(micros);
                        }
                        test.on_sdo_answer(at(micros), joint, word);
                        requested[drive].take().is_some_and(|from| from <= grace_end)
                            && micros <= grace_end + 200_000
                    }
                };
                if is_in_time && !power::may_apply_torque(word) {
                    off[drive] = true;
                }
            }
            let tripped = test.outcome().map(|outcome| outcome.unwrap().is_ok());
            prop_assert_eq!(tripped, off);
            prop_assert_eq!(test.deadline(at(1_300_000)), None);
        }
    }
}
