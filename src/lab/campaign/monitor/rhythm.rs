//! When the node speaks: I5, I7 and I10.

use std::time::Duration;

use crate::campaign::monitor::law::Breaches;
use crate::campaign::monitor::law::Law;
use crate::campaign::monitor::sheet::Sheet;
use crate::campaign::monitor::sheet::Told;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::sync;
use units::time::Instant;

/// So many SYNCs are remembered.
const REMEMBERED: usize = 10;

/// A heartbeat belongs to a cycle: so many periods after its SYNC it is none of this one's.
const ALIVE: u32 = 2;

/// What was heard of the rhythm.
#[derive(Clone, Debug)]
pub(super) struct Rhythm {
    buses: Vec<Beat>,
    /// How often each RPDO came since the last SYNC of its bus.
    came: Vec<u32>,
    /// Nobody's fault, or not altogether.
    excuses: Vec<Excuse>,
    /// When the last SYNC of each bus was given away.
    given: Vec<Option<Instant>>,
}

/// What is broken, so that targets do not come, or late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Excuse {
    /// A bus, from then on: what is on its wire, and when, is not the node's doing.
    Bus(Channel, Instant),
    /// The process, from then until then. What it says late must be zero.
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
            excuses: Vec::new(),
            given: vec![None; buses],
        }
    }

    /// Targets may be missing, but never come in bursts.
    pub(super) fn excuse(&mut self, excuse: Excuse) {
        self.excuses.push(excuse);
    }

    /// A bus has taken a frame. I7: a heartbeat has the SYNC of its cycle before it, once `is_proven` that
    /// the drives stop by themselves: to prove that, the node keeps its SYNCs back.
    pub(super) fn on_taken(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        ((channel, frame), is_proven): ((Channel, &Frame), bool),
        breaches: &mut Breaches,
    ) {
        let Some(given) = self.given.get_mut(usize::from(channel.0)) else { return };
        if frame.cob_id == sync::COB_ID {
            *given = Some(at);
        } else if frame.cob_id == sheet.heartbeat
            && is_proven
            && given.is_none_or(|given| at.since(given) > sheet.period * ALIVE)
        {
            breaches.add(Law::Heartbeat, at, "a heartbeat without a SYNC before it".to_owned());
        }
    }

    /// A frame on the wire at `at` that was given away at `since`.
    pub(super) fn on_sent(
        &mut self,
        sheet: &Sheet,
        (at, since): (Instant, Instant),
        (channel, frame): (Channel, &Frame),
        breaches: &mut Breaches,
    ) {
        if frame.cob_id == sync::COB_ID {
            self.sync(sheet, at, channel, breaches);
        } else if let Some((place, rpdo)) = sheet.rpdo(channel, frame)
            && rpdo.is_cyclic
        {
            let after = self.since_sync(channel, since);
            let late = after.is_none_or(|after| after > late(sheet.period));
            let asks =
                rpdo.read(frame).any(|told| matches!(told, Told::Target(_, target) if target != 0));
            let is_excused = match self.excuse_of(at, channel) {
                Some(Excuse::Bus(..)) => true,
                Some(Excuse::Process(..)) => !asks,
                None => false,
            };
            if late && !is_excused {
                let what = format!("{frame} comes more than half a period late");
                breaches.add(Law::OncePerSync, at, what);
            }
            self.came.iter_mut().skip(place).take(1).for_each(|came| *came += 1);
        }
    }

    /// I5 of the cycle that is over, and I10.
    fn sync(&mut self, sheet: &Sheet, at: Instant, channel: Channel, breaches: &mut Breaches) {
        let is_excused = self.excuse_of(at, channel).is_some();
        let Some(beat) = self.buses.get_mut(usize::from(channel.0)) else { return };
        let rpdos = sheet.rpdos.iter().zip(&mut self.came);
        for (rpdo, came) in rpdos.filter(|(rpdo, _)| rpdo.channel == channel && rpdo.is_cyclic) {
            if *came != 1 && beat.latest().is_some() && !is_excused {
                let what = format!("{:03X}h came {came} times after one SYNC", rpdo.cob_id);
                breaches.add(Law::OncePerSync, at, what);
            }
            *came = 0;
        }
        let mut periods = 0;
        for before in beat.last.iter().rev() {
            periods += 1;
            let Some(before) = before else { break };
            if at.since(*before) <= least(sheet.period, periods) {
                let what = format!("{} SYNCs within {:?}", periods + 1, at.since(*before));
                breaches.add(Law::NoBurst, at, what);
                break;
            }
        }
        beat.last.rotate_left(1);
        beat.last.iter_mut().last().into_iter().for_each(|last| *last = Some(at));
    }

    fn since_sync(&self, channel: Channel, at: Instant) -> Option<Duration> {
        let latest = self.buses.get(usize::from(channel.0))?.latest()?;
        Some(at.since(latest))
    }

    fn excuse_of(&self, at: Instant, channel: Channel) -> Option<Excuse> {
        let is_it = |excuse: &&Excuse| match **excuse {
            Excuse::Bus(bus, from) => bus == channel && at >= from,
            Excuse::Process(from, until) => at >= from && at <= until,
        };
        self.excuses.iter().find(is_it).copied()
    }
}

/// SYNCs that each have a period of their own are not so near each other: one is less than a period late. Two
/// of them are given away half a period apart at least; the first may have had to wait for what else a loop
/// says that stood still: six targets of zero, a quarter of a period.
fn least(period: Duration, periods: u32) -> Duration {
    match periods {
        0 | 1 => period / 4,
        periods => period * (periods - 1),
    }
}

/// Half a period late is as late as may be.
fn late(period: Duration) -> Duration {
    period + period / 2
}
