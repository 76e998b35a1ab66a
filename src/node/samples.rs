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

/// Where the cyclic frame of a node comes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Source {
    /// Its bus.
    pub(super) channel: Channel,
    /// Its COB-ID.
    pub(super) cob_id: u16,
}

impl Source {
    fn is_of(&self, telegram: &Telegram) -> bool {
        self.channel == telegram.channel && self.cob_id == telegram.frame.cob_id
    }
}

/// The newest sample of each joint.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    drives: [Source; 6],
    switches: Source,
    patience: u32,
    latest: [DriveSample; 6],
    fresh: [bool; 6],
    missing: [u32; 6],
    inputs: Option<(Instant, SwitchInputs)>,
    malformed: u64,
}

impl Samples {
    /// Nothing heard yet. `patience` is how many cycles in a row a joint may miss.
    pub(super) fn new(drives: [Source; 6], switches: Source, patience: u32) -> Self {
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
        for ((source, latest), fresh) in joints {
            if source.is_of(telegram) {
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
