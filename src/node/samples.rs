//! What the drives and the switch box last said, and whether they said it in this cycle.

use std::time::Duration;

use crate::cause::Cause;
use crate::plausibility::Intake;
use crate::plausibility::Offer;
use crate::plausibility::Sampled;
use canopen::drive::Statusword;
use canopen::exchange::Inbox;
use canopen::exchange::Told;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::pdo::DriveSample;
use config::switch_inputs::SwitchInputs;
use units::numbering::Joint;
use units::time::Instant;

/// The switch box repeats its inputs every 5 ms; after three of those in silence it is not believed.
const SWITCHES_STALE: Duration = Duration::from_millis(15);

/// A statusword that does not come with the position is repeated; this many in silence are too many.
const STATUS_MISSED: u32 = 3;

/// The newest sample of each joint.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    inbox: Inbox,
    /// Which of the positions that come are samples.
    intakes: [Intake; 6],
    patience: u32,
    /// The bus of each joint.
    channels: [Channel; 6],
    /// How old a joint's statusword may be; `None` where it comes with the position.
    status_stale: [Option<Duration>; 6],
    latest: [DriveSample; 6],
    /// When each joint last told its state.
    status_at: [Option<Instant>; 6],
    /// When the last SYNC went out.
    asked_at: Instant,
    fresh: [bool; 6],
    /// Which joints have told their torque since that was last asked.
    torques: [bool; 6],
    missing: [u32; 6],
    /// What a position that cannot be stops the node for.
    wrong: Option<Cause>,
    inputs: Option<(Instant, SwitchInputs)>,
    malformed: u64,
}

impl Samples {
    /// Nothing heard yet. The nodes of `inbox` are the joints, then the switch box. `patience` is how
    /// many cycles in a row a joint may miss.
    pub(super) fn new(
        inbox: Inbox,
        intakes: [Intake; 6],
        channels: [Channel; 6],
        patience: u32,
    ) -> Self {
        let stale = |joint: Joint| Some(inbox.status_repeated(joint.into())? * STATUS_MISSED);
        Self {
            intakes,
            patience,
            channels,
            status_stale: Joint::ALL.map(stale),
            latest: [DriveSample::default(); 6],
            status_at: [None; 6],
            asked_at: Instant::ZERO,
            fresh: [false; 6],
            torques: [false; 6],
            missing: [0; 6],
            wrong: None,
            inputs: None,
            malformed: 0,
            inbox,
        }
    }

    /// A SYNC goes out: what comes in from now on belongs to it.
    pub(super) fn begin(&mut self, now: Instant) {
        self.asked_at = now;
        self.intakes.iter_mut().for_each(|intake| intake.begin(now));
        self.fresh = [false; 6];
    }

    /// Takes a frame; false if it is none of the exchange. One of the wrong length counts as not come.
    pub(super) fn on_frame(&mut self, at: Instant, telegram: &Telegram) -> bool {
        match self.inbox.read(telegram) {
            None => return false,
            Some(Ok(told)) => self.take(at, told),
            Some(Err(_)) => self.malformed += 1,
        }
        true
    }

    /// Takes a frame that waited too long to be read: its position is late, and not lost.
    pub(super) fn discard(&mut self, telegram: &Telegram) {
        let Some(Ok(told)) = self.inbox.read(telegram) else { return };
        if let (Some(_), Some(joint)) = (told.position, told.node.joint()) {
            joint.entry_mut(&mut self.intakes).discard();
        }
    }

    fn take(&mut self, at: Instant, told: Told) {
        if let Some(inputs) = told.inputs {
            self.inputs = Some((at, SwitchInputs::from_bits(inputs)));
        }
        let Some(joint) = told.node.joint() else { return };
        let sample = joint.entry_mut(&mut self.latest);
        if let Some(torque) = told.torque {
            sample.torque = torque;
            *joint.entry_mut(&mut self.torques) = true;
        }
        if let Some(word) = told.statusword {
            sample.statusword = word;
            *joint.entry_mut(&mut self.status_at) = Some(at);
        }
        if let Some(position) = told.position {
            match joint.entry_mut(&mut self.intakes).offer(position) {
                Offer::Sample => {
                    sample.position = position;
                    *joint.entry_mut(&mut self.fresh) = true;
                }
                Offer::Ignored => {}
                Offer::Wrong(cause) => self.wrong = self.wrong.or(Some(cause)),
            }
        }
    }

    /// Whether every joint has answered this SYNC.
    pub(super) fn is_complete(&self) -> bool {
        self.fresh == [true; 6]
    }

    /// The window is over: says whose position cannot be, counts who is missing, and says who has been
    /// for too long.
    pub(super) fn end(&mut self, now: Instant) -> Option<Cause> {
        let mut lost = self.wrong.take();
        for (joint, (missing, fresh)) in Joint::each(self.missing.iter_mut().zip(&self.fresh)) {
            *missing = if *fresh { 0 } else { missing.saturating_add(1) };
            if *missing >= self.patience {
                lost = lost.or(Some(Cause::SamplesMissing { joint, cycles: *missing }));
            }
        }
        if let Some(Cause::SamplesMissing { joint, cycles }) = lost {
            lost = self.bus_silent(joint, cycles).or(lost);
        }
        let overdue = || self.intakes.iter().find_map(Intake::overdue);
        lost.or_else(overdue).or_else(|| self.status_missing(now))
    }

    /// The cause if the bus of `joint` is silent: none of its drives, and more than one, answers.
    fn bus_silent(&self, joint: Joint, cycles: u32) -> Option<Cause> {
        let channel = joint.entry(&self.channels);
        let drives = || self.channels.iter().zip(&self.missing).filter(|(of, _)| *of == channel);
        // Those that answered before the bus fell silent in the middle of a cycle are one behind.
        let is_silent = |missing: u32| missing > 0 && missing + 1 >= self.patience;
        let are_silent = drives().all(|(_, missing)| is_silent(*missing));
        let channel = channel.0;
        (are_silent && drives().count() > 1).then_some(Cause::BusSilent { channel, cycles })
    }

    /// The first joint that has not told its state for too long. Before it ever has, that it is not
    /// enabled says enough.
    fn status_missing(&self, now: Instant) -> Option<Cause> {
        let joints = Joint::each(self.status_at.iter().zip(&self.status_stale));
        let mut silent = joints.filter_map(|(joint, (heard, stale))| {
            let silent = now.since((*heard)?);
            (silent > (*stale)?).then_some(Cause::StatusMissing { joint })
        });
        silent.next()
    }

    /// Forgets what was missed: drives that had left operational, and answered no SYNC, are started again.
    pub(super) fn start_again(&mut self) {
        self.missing = [0; 6];
        self.wrong = None;
        self.intakes.iter_mut().for_each(Intake::restart);
    }

    /// Forgets what was missed and what state the drives were in: the network starts anew.
    pub(super) fn restart(&mut self) {
        self.start_again();
        self.fresh = [false; 6];
        self.torques = [false; 6];
        self.status_at = [None; 6];
        self.latest.iter_mut().for_each(|sample| sample.statusword = Statusword::default());
        self.inputs = None;
    }

    /// The newest sample of each joint.
    pub(super) fn latest(&self) -> &[DriveSample; 6] {
        &self.latest
    }

    /// What has come since this was last asked: positions of this SYNC, torques that may have come after
    /// the positions of the one before.
    pub(super) fn sampled(&mut self) -> Sampled<'_> {
        let torques = std::mem::take(&mut self.torques);
        Sampled { at: self.asked_at, latest: &self.latest, fresh: self.fresh, torques }
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
    use std::path::Path;

    use super::*;
    use crate::plausibility;
    use canopen::frame::Channel;
    use canopen::frame::Frame;
    use config::Config;
    use units::drive::Counts;

    /// As `name` has it: `kraft_like_500hz` with all in one TPDO, `kraft_like` with the state apart.
    fn samples(name: &str) -> Samples {
        let config = Config::load(Path::new(&format!("config/{name}.toml"))).unwrap();
        Samples::new(
            config.exchange().inbox.clone(),
            plausibility::intakes(&config),
            [Channel(0); 6],
            3,
        )
    }

    fn hear(samples: &mut Samples, at: u64, cob_id: u16, data: &[u8]) -> bool {
        let frame = Frame::from_slice(cob_id, data).unwrap();
        samples.on_frame(Instant::from_micros(at), &Telegram { channel: Channel(0), frame })
    }

    fn answer(samples: &mut Samples, joint: u16) {
        assert!(hear(samples, 0, 0x180 + joint, &[0x37, 0x02, 7, 0, 0, 0, 0, 0]));
    }

    #[test]
    fn a_cycle_is_complete_when_every_joint_has_answered_its_sync() {
        let mut samples = samples("kraft_like_500hz");
        samples.begin(Instant::ZERO);
        (1..=5).for_each(|joint| answer(&mut samples, joint));
        assert!(!samples.is_complete());
        answer(&mut samples, 6);
        assert!(samples.is_complete());
        assert_eq!(samples.latest()[5].position, Counts(7));
        samples.begin(Instant::ZERO);
        assert!(!samples.is_complete(), "the next SYNC asks anew");
    }

    #[test]
    fn a_joint_that_misses_too_often_in_a_row_is_named_and_one_answer_forgives() {
        let mut samples = samples("kraft_like_500hz");
        let mut cycle = |answering: &[u16]| {
            samples.begin(Instant::ZERO);
            answering.iter().for_each(|joint| answer(&mut samples, *joint));
            samples.end(Instant::ZERO)
        };
        let (all, without_two) = ([1, 2, 3, 4, 5, 6], [1, 3, 4, 5, 6]);
        assert_eq!([cycle(&without_two), cycle(&without_two), cycle(&all)], [None; 3]);
        assert_eq!([cycle(&without_two), cycle(&without_two)], [None; 2]);
        let cause = Cause::SamplesMissing { joint: Joint::of::<2>(), cycles: 3 };
        assert_eq!(cycle(&without_two), Some(cause));
    }

    #[test]
    fn a_frame_of_the_wrong_length_or_on_the_other_bus_is_no_answer() {
        let mut samples = samples("kraft_like_500hz");
        samples.begin(Instant::ZERO);
        assert!(hear(&mut samples, 0, 0x181, &[0x37, 0x02]));
        let frame = Frame::new(0x182, [0; 8]);
        assert!(!samples.on_frame(Instant::ZERO, &Telegram { channel: Channel(1), frame }));
        assert_eq!(samples.fresh(), [false; 6]);
    }

    #[test]
    fn a_switch_box_that_falls_silent_is_not_believed() {
        let mut samples = samples("kraft_like");
        assert!(hear(&mut samples, 1_000, 0x190, &[0b0001]));
        assert!(samples.inputs(Instant::from_micros(16_000)).is_some());
        assert!(samples.inputs(Instant::from_micros(16_001)).is_none());
    }

    #[test]
    fn a_state_that_comes_by_itself_answers_no_sync() {
        let mut samples = samples("kraft_like");
        samples.begin(Instant::ZERO);
        assert!(hear(&mut samples, 0, 0x281, &[0x37, 0x02]));
        assert_eq!(samples.fresh(), [false; 6]);
        assert!(hear(&mut samples, 0, 0x181, &[7, 0, 0, 0]));
        assert_eq!(samples.fresh(), [true, false, false, false, false, false]);
        let sample = samples.latest()[0];
        assert_eq!((sample.statusword.0, sample.position), (0x0237, Counts(7)));
    }

    #[test]
    fn a_state_that_is_not_repeated_is_missed_although_positions_come() {
        let mut samples = samples("kraft_like");
        hear(&mut samples, 1_000, 0x283, &[0x37, 0x02]);
        samples.begin(Instant::ZERO);
        (1..=6).for_each(|joint| assert!(hear(&mut samples, 1_000, 0x180 + joint, &[0; 4])));
        assert_eq!(samples.end(Instant::from_micros(151_000)), None);
        let cause = Some(Cause::StatusMissing { joint: Joint::of::<3>() });
        assert_eq!(samples.end(Instant::from_micros(151_001)), cause);
        samples.restart();
        assert_eq!(samples.latest()[2].statusword, Statusword::default());
        assert_eq!(samples.end(Instant::from_micros(151_002)), None);
    }
}
