//! What the drives and the switch box last said, and whether they said it in this cycle.

use std::time::Duration;

use crate::canopen::frame::Channel;
use crate::canopen::frame::Telegram;
use crate::canopen::pdo::DriveSample;
use crate::canopen::pdo::SwitchInputs;
use crate::telemetry::record::Cause;
use crate::time::Instant;

/// The switch box repeats its inputs every 5 ms; after three of those in silence it is not believed.
const SWITCHES_STALE: Duration = Duration::from_millis(15);

/// Where a cyclic frame is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Its bus.
    pub(super) channel: Channel,
    /// Its COB-ID.
    pub(super) cob_id: u16,
}

impl Place {
    fn is_of(&self, telegram: &Telegram) -> bool {
        self.channel == telegram.channel && self.cob_id == telegram.frame.cob_id
    }
}

/// The newest sample of each joint.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    drives: [Place; 6],
    switches: Place,
    patience: u32,
    latest: [DriveSample; 6],
    fresh: [bool; 6],
    missing: [u32; 6],
    inputs: Option<(Instant, SwitchInputs)>,
    malformed: u64,
}

impl Samples {
    /// Nothing heard yet. `patience` is how many cycles in a row a joint may miss.
    pub(super) fn new(drives: [Place; 6], switches: Place, patience: u32) -> Self {
        Self {
            drives,
            switches,
            patience,
            latest: [DriveSample::default(); 6],
            fresh: [false; 6],
            missing: [0; 6],
            inputs: None,
            malformed: 0,
        }
    }

    /// A SYNC goes out: what comes in from now on belongs to it.
    pub(super) fn begin(&mut self) {
        self.fresh = [false; 6];
    }

    /// Takes a cyclic frame; false if it is none. One of the wrong length counts as not come.
    pub(super) fn on_frame(&mut self, at: Instant, telegram: &Telegram) -> bool {
        if self.switches.is_of(telegram) {
            match SwitchInputs::decode(telegram.frame.data()) {
                Ok(inputs) => self.inputs = Some((at, inputs)),
                Err(_) => self.malformed += 1,
            }
            return true;
        }
        let joints = self.drives.iter().zip(&mut self.latest).zip(&mut self.fresh);
        for ((place, latest), fresh) in joints {
            if place.is_of(telegram) {
                match DriveSample::decode(telegram.frame.data()) {
                    Ok(sample) => (*latest, *fresh) = (sample, true),
                    Err(_) => self.malformed += 1,
                }
                return true;
            }
        }
        false
    }

    /// Whether every joint has answered this SYNC.
    pub(super) fn is_complete(&self) -> bool {
        self.fresh == [true; 6]
    }

    /// The window is over: counts who is missing, and says who has been for too long.
    pub(super) fn end(&mut self) -> Option<Cause> {
        let mut lost = None;
        for (joint, (missing, fresh)) in (1..).zip(self.missing.iter_mut().zip(&self.fresh)) {
            *missing = if *fresh { 0 } else { missing.saturating_add(1) };
            if *missing >= self.patience {
                lost = lost.or(Some(Cause::SamplesMissing { joint, cycles: *missing }));
            }
        }
        lost
    }

    /// Forgets what was missed: the network starts anew.
    pub(super) fn restart(&mut self) {
        self.missing = [0; 6];
        self.fresh = [false; 6];
        self.inputs = None;
    }

    /// The newest sample of each joint.
    pub(super) fn latest(&self) -> &[DriveSample; 6] {
        &self.latest
    }

    /// Which joints answered this SYNC.
    pub(super) fn fresh(&self) -> [bool; 6] {
        self.fresh
    }

    /// The switch box's inputs, unless they are too old to be believed.
    pub(super) fn inputs(&self, now: Instant) -> Option<SwitchInputs> {
        self.inputs.filter(|(at, _)| now.since(*at) <= SWITCHES_STALE).map(|(_, inputs)| inputs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::drive::Statusword;
    use crate::canopen::frame::Frame;
    use crate::canopen::pdo::Counts;

    fn samples() -> Samples {
        let place = |cob_id| Place { channel: Channel(0), cob_id };
        let drives = [0x181, 0x182, 0x183, 0x184, 0x185, 0x186].map(place);
        Samples::new(drives, place(0x190), 3)
    }

    fn answer(samples: &mut Samples, joint: u16, position: i32) -> bool {
        let statusword = Statusword(0x0237);
        let sample =
            DriveSample { statusword, position: Counts(position), ..DriveSample::default() };
        let frame = Frame::new(0x180 + joint, sample.encode());
        samples.on_frame(Instant::ZERO, &Telegram { channel: Channel(0), frame })
    }

    #[test]
    fn a_cycle_is_complete_when_every_joint_has_answered_its_sync() {
        let mut samples = samples();
        samples.begin();
        (1..=5).for_each(|joint| assert!(answer(&mut samples, joint, 7)));
        assert!(!samples.is_complete());
        answer(&mut samples, 6, 7);
        assert!(samples.is_complete());
        samples.begin();
        assert!(!samples.is_complete(), "the next SYNC asks anew");
    }

    #[test]
    fn a_joint_that_misses_too_often_in_a_row_is_named_and_one_answer_forgives() {
        let mut samples = samples();
        let mut cycle = |answering: &[u16]| {
            samples.begin();
            answering.iter().for_each(|joint| assert!(answer(&mut samples, *joint, 0)));
            samples.end()
        };
        let (all, without_two) = ([1, 2, 3, 4, 5, 6], [1, 3, 4, 5, 6]);
        assert_eq!([cycle(&without_two), cycle(&without_two), cycle(&all)], [None; 3]);
        assert_eq!([cycle(&without_two), cycle(&without_two)], [None; 2]);
        let cause = Cause::SamplesMissing { joint: 2, cycles: 3 };
        assert_eq!(cycle(&without_two), Some(cause));
    }

    #[test]
    fn a_frame_of_the_wrong_length_or_on_the_other_bus_is_no_answer() {
        let mut samples = samples();
        samples.begin();
        let frame = Frame::new(0x181, [0x37, 0x02]);
        assert!(samples.on_frame(Instant::ZERO, &Telegram { channel: Channel(0), frame }));
        let frame = Frame::new(0x182, DriveSample::default().encode());
        assert!(!samples.on_frame(Instant::ZERO, &Telegram { channel: Channel(1), frame }));
        assert_eq!(samples.fresh(), [false; 6]);
    }

    #[test]
    fn a_switch_box_that_falls_silent_is_not_believed() {
        let mut samples = samples();
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x190, [0b0001]) };
        samples.on_frame(Instant::from_micros(1_000), &telegram);
        assert!(samples.inputs(Instant::from_micros(16_000)).is_some());
        assert!(samples.inputs(Instant::from_micros(16_001)).is_none());
    }
}
