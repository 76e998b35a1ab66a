//! Times of the node's frames: I5, I7 and I10.

use std::time::Duration;

use crate::monitor::invariant::{Invariant, Moment};
use crate::monitor::sheet::{Command, Sheet};
use canopen::frame::{Channel, Telegram};
use canopen::sync;
use units::time::Instant;

/// Number of SYNCs that are remembered.
const REMEMBERED: usize = 10;

/// Most periods from the SYNC of a cycle to its heartbeat.
const MAX_HEARTBEAT_PERIODS: u32 = 2;

/// Times of SYNCs and RPDOs.
#[derive(Clone, Debug)]
pub(super) struct Rhythm {
    buses: Vec<Beat>,
    /// Number of each RPDO since the last SYNC of its bus.
    came: Vec<u32>,
    exemptions: Vec<Exemption>,
    /// Time at which the last SYNC of each bus was sent.
    given: Vec<Option<Instant>>,
}

/// An exemption from I5: targets may be missing or late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exemption {
    /// A bus, from this time on: the times of its frames are not the node's.
    Bus(Channel, Instant),
    /// The process, in this interval. Late targets must be zero.
    Process(Instant, Instant),
}

/// The last SYNCs of one bus, the newest last.
#[derive(Clone, Copy, Debug, Default)]
struct Beat {
    last: [Option<Instant>; REMEMBERED],
}

impl Beat {
    fn latest(&self) -> Option<Instant> {
        self.last.last().copied().flatten()
    }
}

impl Rhythm {
    pub(super) fn new(sheet: &Sheet, buses: usize) -> Self {
        Self {
            buses: vec![Beat::default(); buses],
            came: vec![0; sheet.rpdos.len()],
            exemptions: Vec::new(),
            given: vec![None; buses],
        }
    }

    /// Exempts a bus or the process from I5; I10 holds all the same.
    pub(super) fn exempt(&mut self, exemption: Exemption) {
        self.exemptions.push(exemption);
    }

    /// Takes a frame that a bus has accepted. I7: a heartbeat follows the SYNC of its cycle while `is_driven`: for the
    /// proof test, and after its last cycle, the node sends heartbeats without SYNCs.
    pub(super) fn on_taken(
        &mut self,
        moment: &mut Moment<'_>,
        Telegram { channel, frame }: &Telegram,
        is_driven: bool,
    ) {
        let (sheet, at) = (moment.sheet, moment.at);
        let Some(given) = self.given.get_mut(usize::from(channel.0)) else { return };
        if frame.cob_id == sync::COB_ID {
            *given = Some(at);
        } else if frame.cob_id == sheet.heartbeat
            && is_driven
            && given.is_none_or(|given| at.since(given) > sheet.period * MAX_HEARTBEAT_PERIODS)
        {
            moment.violates(Invariant::Heartbeat, "a heartbeat without a SYNC before it");
        }
    }

    /// Takes a frame on the wire that was sent at `since`.
    pub(super) fn on_sent(
        &mut self,
        moment: &mut Moment<'_>,
        since: Instant,
        &Telegram { channel, ref frame }: &Telegram,
    ) {
        let (sheet, at) = (moment.sheet, moment.at);
        if frame.cob_id == sync::COB_ID {
            self.sync(moment, channel);
        } else if let Some((place, rpdo)) = sheet.rpdo(channel, frame)
            && rpdo.is_cyclic
        {
            let after = self.since_sync(channel, since);
            let late = after.is_none_or(|after| after > late(sheet.period));
            let asks = rpdo
                .read(frame)
                .any(|one| matches!(one, Command::Target(_, target) if target != 0));
            let is_exempt = match self.exemption(at, channel) {
                Some(Exemption::Bus(..)) => true,
                Some(Exemption::Process(..)) => !asks,
                None => false,
            };
            if late && !is_exempt {
                let what = format!("{frame} comes more than half a period late");
                moment.violates(Invariant::OncePerSync, what);
            }
            self.came.iter_mut().skip(place).take(1).for_each(|came| *came += 1);
        }
    }

    /// Checks I5 of the last cycle, and I10.
    fn sync(&mut self, moment: &mut Moment<'_>, channel: Channel) {
        let (sheet, at) = (moment.sheet, moment.at);
        let is_exempt = self.exemption(at, channel).is_some();
        let Some(beat) = self.buses.get_mut(usize::from(channel.0)) else { return };
        let rpdos = sheet.rpdos.iter().zip(&mut self.came);
        for (rpdo, came) in rpdos.filter(|(rpdo, _)| rpdo.channel == channel && rpdo.is_cyclic) {
            if *came != 1 && beat.latest().is_some() && !is_exempt {
                let what = format!("{:03X}h came {came} times after one SYNC", rpdo.cob_id);
                moment.violates(Invariant::OncePerSync, what);
            }
            *came = 0;
        }
        let mut periods = 0;
        for before in beat.last.iter().rev() {
            periods += 1;
            let Some(before) = before else { break };
            if at.since(*before) <= burst_time(sheet.period, periods) {
                let what = format!("{} SYNCs within {:?}", periods + 1, at.since(*before));
                moment.violates(Invariant::NoBurst, what);
                break;
            }
        }
        beat.last.rotate_left(1);
        beat.last.iter_mut().last().into_iter().for_each(|last| *last = Some(at));
    }

    /// Returns whether the process does not run at a time.
    pub(super) fn is_process_exempt(&self, at: Instant) -> bool {
        self.exemptions.iter().any(|exemption| match *exemption {
            Exemption::Process(from, until) => (from..=until).contains(&at),
            Exemption::Bus(..) => false,
        })
    }

    fn since_sync(&self, channel: Channel, at: Instant) -> Option<Duration> {
        let latest = self.buses.get(usize::from(channel.0))?.latest()?;
        Some(at.since(latest))
    }

    fn exemption(&self, at: Instant, channel: Channel) -> Option<Exemption> {
        let is_it = |exemption: &&Exemption| match **exemption {
            Exemption::Bus(bus, from) => bus == channel && at >= from,
            Exemption::Process(from, until) => at >= from && at <= until,
        };
        self.exemptions.iter().find(is_it).copied()
    }
}

/// Returns the time below which SYNCs `periods` apart are a burst. One may be nearly a period late. Two are sent at
/// least half a period apart, of which six late targets of zero may take a quarter.
fn burst_time(period: Duration, periods: u32) -> Duration {
    match periods {
        0 | 1 => period / 4,
        periods => period * (periods - 1),
    }
}

/// Returns the latest time of a target after its SYNC: half a period late.
fn late(period: Duration) -> Duration {
    period + period / 2
}
