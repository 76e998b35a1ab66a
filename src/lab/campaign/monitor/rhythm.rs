//! When the node speaks: I5, I7 and I10.

use std::time::Duration;

use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::sync;
use crate::lab::campaign::monitor::law::Breaches;
use crate::lab::campaign::monitor::law::Law;
use crate::lab::campaign::monitor::sheet::Sheet;
use crate::time::Instant;

/// So many SYNCs are remembered.
const REMEMBERED: usize = 10;

/// A SYNC may wait for the frame that is on the wire, of 135 bits at most, and a bit more.
const WIRE: Duration = Duration::from_micros(200);

/// A heartbeat has the lowest priority of all, and may wait for so many cycles of a crowded bus.
const ALIVE: u32 = 5;

/// What was heard of the rhythm.
#[derive(Clone, Debug)]
pub(super) struct Rhythm {
    buses: Vec<Beat>,
    /// How often each RPDO came since the last SYNC of its bus.
    came: Vec<u32>,
    /// The bus itself is broken from then on: what does not come is not the node's fault.
    excused_from: Option<Instant>,
    /// Torque frames that came so late that another cycle had begun.
    pub(super) stale: u64,
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
            excused_from: None,
            stale: 0,
        }
    }

    /// From now on the bus, or the process, is broken: targets may be missing, but never come in bursts.
    pub(super) const fn excuse(&mut self, from: Instant) {
        self.excused_from = Some(from);
    }

    pub(super) fn on_sent(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (channel, frame): (Channel, &Frame),
        breaches: &mut Breaches,
    ) {
        if frame.cob_id == sync::COB_ID {
            self.sync(sheet, at, channel, breaches);
        } else if frame.cob_id == sheet.heartbeat {
            self.heartbeat(sheet, at, channel, breaches);
        } else if let Some((place, rpdo)) = sheet.rpdo(channel, frame)
            && rpdo.is_cyclic
        {
            let late = self.since_sync(channel, at).is_none_or(|since| since > late(sheet.period));
            if late {
                self.stale += 1;
                if !self.is_excused(at) {
                    let what = format!("{frame} comes more than half a period late");
                    breaches.add(Law::OncePerSync, at, what);
                }
            }
            self.came.iter_mut().skip(place).take(1).for_each(|came| *came += 1);
        }
    }

    /// I5 of the cycle that is over, and I10.
    fn sync(&mut self, sheet: &Sheet, at: Instant, channel: Channel, breaches: &mut Breaches) {
        let is_excused = self.is_excused(at);
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
            let least = (sheet.period * periods).saturating_sub(sheet.period / 2 + WIRE);
            if at.since(*before) < least {
                let what = format!("{} SYNCs within {:?}", periods + 1, at.since(*before));
                breaches.add(Law::NoBurst, at, what);
                break;
            }
        }
        beat.last.rotate_left(1);
        beat.last.iter_mut().last().into_iter().for_each(|last| *last = Some(at));
    }

    /// I7.
    fn heartbeat(&self, sheet: &Sheet, at: Instant, channel: Channel, breaches: &mut Breaches) {
        if self.since_sync(channel, at).is_none_or(|since| since > sheet.period * ALIVE) {
            breaches.add(Law::Heartbeat, at, "a heartbeat without a SYNC before it".to_owned());
        }
    }

    fn since_sync(&self, channel: Channel, at: Instant) -> Option<Duration> {
        let latest = self.buses.get(usize::from(channel.0))?.latest()?;
        Some(at.since(latest))
    }

    fn is_excused(&self, at: Instant) -> bool {
        self.excused_from.is_some_and(|from| at >= from)
    }
}

/// Half a period late is as late as may be.
fn late(period: Duration) -> Duration {
    period + period / 2
}
