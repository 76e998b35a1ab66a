//! Times of the node's frames: I5, I7 and I10.

use std::time::Duration;

use crate::monitor::invariant::{Invariant, Moment};
use crate::monitor::sheet::{Command, Sheet};
use crate::monitor::spacing::{Burst, Spacing};
use canopen::frame::{Channel, Telegram};
use canopen::sync;
use units::time::Instant;

/// Maximum number of periods from the SYNC of a cycle to its heartbeat.
const MAX_HEARTBEAT_PERIODS: u32 = 2;

/// Times of SYNCs and RPDOs.
#[derive(Clone, Debug)]
pub(super) struct Rhythm {
    buses: Vec<Spacing>,
    /// Number of each RPDO since the last SYNC of its bus.
    came: Vec<u32>,
    exemptions: Vec<Exemption>,
}

/// Exemption from I5, targets may be missing or late, and of a process from I7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exemption {
    /// Bus, from this time on: the node does not determine the times of its frames.
    Bus(Channel, Instant),
    /// Process, in this interval. Late targets must be zero.
    Process(Instant, Instant),
}

impl Rhythm {
    pub(super) fn new(sheet: &Sheet) -> Self {
        Self {
            buses: sheet.bitrates.iter().map(|bitrate| Spacing::new(*bitrate)).collect(),
            came: vec![0; sheet.rpdos.len()],
            exemptions: Vec::new(),
        }
    }

    /// Exempts a bus or the process from I5. I10 still applies, except to SYNCs held by a disturbed adapter.
    pub(super) fn exempt(&mut self, exemption: Exemption) {
        self.exemptions.push(exemption);
    }

    /// Takes a frame that a bus has accepted. I7: a heartbeat follows the SYNC of its cycle while `is_driven`. For the
    /// proof test, and after its last cycle, the node sends heartbeats without SYNCs. A process that has stood still omits
    /// the SYNC of a slot that is over.
    pub(super) fn on_taken(
        &mut self,
        moment: &mut Moment<'_>,
        Telegram { channel, frame }: &Telegram,
        is_driven: bool,
    ) {
        let (sheet, at) = (moment.sheet, moment.at);
        let is_exempt = self.is_process_exempt(at);
        let Some(bus) = self.buses.get_mut(usize::from(channel.0)) else { return };
        if frame.cob_id == sync::COB_ID {
            let burst = bus.on_accepted(sheet.period, at);
            burst.into_iter().for_each(|burst| report(moment, burst, "handed over"));
        } else if frame.cob_id == sheet.heartbeat
            && is_driven
            && !is_exempt
            && bus
                .latest_accepted()
                .is_none_or(|given| at.since(given) > sheet.period * MAX_HEARTBEAT_PERIODS)
        {
            moment.violates(Invariant::Heartbeat, "a heartbeat without a SYNC before it");
        }
    }

    /// Takes a frame of any sender on the wire.
    pub(super) fn on_wire(&mut self, at: Instant, Telegram { channel, frame }: &Telegram) {
        let bus = self.buses.get_mut(usize::from(channel.0));
        bus.into_iter().for_each(|bus| bus.on_frame(at, frame));
    }

    /// Takes a frame on the wire that was accepted at `since`, after [`on_wire`](Self::on_wire).
    pub(super) fn on_sent(
        &mut self,
        moment: &mut Moment<'_>,
        since: Instant,
        &Telegram { channel, ref frame }: &Telegram,
    ) {
        let (sheet, at) = (moment.sheet, moment.at);
        if frame.cob_id == sync::COB_ID {
            self.sync(moment, since, channel);
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
    fn sync(&mut self, moment: &mut Moment<'_>, since: Instant, channel: Channel) {
        let (sheet, at) = (moment.sheet, moment.at);
        let exemption = self.exemption(at, channel);
        let is_disturbed = matches!(exemption, Some(Exemption::Bus(..)));
        let Some(bus) = self.buses.get_mut(usize::from(channel.0)) else { return };
        let rpdos = sheet.rpdos.iter().zip(&mut self.came);
        for (rpdo, came) in rpdos.filter(|(rpdo, _)| rpdo.channel == channel && rpdo.is_cyclic) {
            if *came != 1 && bus.latest().is_some() && exemption.is_none() {
                let what = format!("{:03X}h came {came} times after one SYNC", rpdo.cob_id);
                moment.violates(Invariant::OncePerSync, what);
            }
            *came = 0;
        }
        let burst = bus.on_sync(sheet.period, [since, at], is_disturbed);
        burst.into_iter().for_each(|burst| report(moment, burst, "on the wire"));
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

/// Reports I10.
fn report(moment: &mut Moment<'_>, Burst { syncs, within }: Burst, place: &str) {
    moment.violates(Invariant::NoBurst, format!("{syncs} SYNCs {place} within {within:?}"));
}

/// Returns the latest time of a target after its SYNC: half a period late.
fn late(period: Duration) -> Duration {
    period + period / 2
}
