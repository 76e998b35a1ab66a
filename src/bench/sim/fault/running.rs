//! Running fault: the frames it applies to, and the state kept since its start.

use crate::drivetrain::MotorReading;
use crate::fault::breakable::{Breakable, Direction};
use crate::fault::devices::{Devices, present};
use crate::random::SplitMix;
use canopen::frame::{Channel, Frame, Telegram};
use faults::{
    ContactFault, Disconnection, Effect, Extent, Fault, FaultKind, FrameFault, Selection,
    SensorFault, Service, Target,
};
use units::numbering::{Joint, NodeIndex};
use units::time::Instant;

/// Started fault with its random sequence and counts.
#[derive(Clone, Debug)]
pub(super) struct Running {
    pub(super) fault: Fault,
    pub(super) until: Option<Instant>,
    /// Time of the next foreign frame.
    pub(super) sends: Option<Instant>,
    /// Places that it disconnects from their bus.
    disconnected: [bool; 7],
    imitation: Option<Imitation>,
    /// Random sequence of this fault alone, so that no fault changes another's.
    random: SplitMix,
    /// Number of frames that it was matched with.
    matched: u32,
    frames: Vec<(NodeIndex, Direction, Frame)>,
    senses: [Option<MotorReading>; 6],
}

/// One device's data, sent again under another one's COB-ID.
#[derive(Clone, Copy, Debug)]
struct Imitation {
    /// Device whose data is sent again.
    of: NodeIndex,
    /// COB-ID under which it sends the data itself.
    original: u16,
    /// Bus on which the data is sent again.
    channel: Channel,
    /// COB-ID under which the data is sent again.
    imitated: u16,
}

/// Target among the simulated devices.
pub(super) trait OfDevices {
    /// Returns whether the target contains the device at a place.
    fn has(self, place: NodeIndex) -> bool;

    /// Returns the bus that is the target.
    fn bus(self) -> Option<Channel>;
}

impl OfDevices for Target {
    fn has(self, place: NodeIndex) -> bool {
        match self {
            Self::Joint(joint) => place.joint() == Some(joint),
            Self::Drives => place.joint().is_some(),
            Self::SwitchBox => place.joint().is_none(),
            Self::Bus(_) | Self::Link | Self::Host => false,
        }
    }

    fn bus(self) -> Option<Channel> {
        match self {
            Self::Bus(channel) => Some(channel),
            Self::Joint(_) | Self::Drives | Self::SwitchBox | Self::Link | Self::Host => None,
        }
    }
}

impl Running {
    /// Creates a fault that starts at `now`, with the random sequence of `seed`.
    pub(super) fn new(fault: Fault, now: Instant, seed: u64) -> Self {
        Self {
            fault,
            until: fault.duration.map(|span| now + span),
            sends: None,
            disconnected: [false; 7],
            imitation: None,
            random: SplitMix::new(seed),
            matched: 0,
            frames: Vec::new(),
            senses: [None; 6],
        }
    }

    /// Disconnects the targets; a cut wire disconnects those behind them as well.
    pub(super) fn disconnect(&mut self, how: Disconnection, devices: &mut Devices<'_>) {
        let mut ended: [Option<Channel>; 7] = [None; 7];
        for (place, device) in present(devices) {
            let is_target = self.fault.target.has(place);
            let channel = Some(device.channel());
            let is_behind = how == Disconnection::WireCut && ended.contains(&channel);
            if let (true, Some(end)) = (is_target, ended.get_mut(place.0)) {
                *end = channel;
            }
            if let (true, Some(is_disconnected)) =
                (is_target || is_behind, self.disconnected.get_mut(place.0))
            {
                *is_disconnected = true;
                if how == Disconnection::Unplugged {
                    device.switch_off();
                }
            }
        }
    }

    /// Returns whether this fault disconnects the device at a place.
    pub(super) fn is_disconnected(&self, place: NodeIndex) -> bool {
        self.disconnected.get(place.0).is_some_and(|is_disconnected| *is_disconnected)
    }

    /// Starts to repeat the frames of `service` from joint `by` as if sent by the target.
    pub(super) fn imitate(&mut self, by: Joint, service: Service, devices: &Devices<'_>) {
        let service_of = |place: NodeIndex| {
            let device = devices.get(place.0)?.as_ref()?;
            Some((device.channel(), device.cob_id(Direction::FromDevice, service)?))
        };
        let mut places = NodeIndex::each(devices).map(|(place, _)| place);
        let target = places.find(|place| self.fault.target.has(*place));
        let of = by.into();
        if let (Some((_, original)), Some((channel, imitated))) =
            (service_of(of), target.and_then(service_of))
        {
            self.imitation = Some(Imitation { of, original, channel, imitated });
        }
    }

    /// Returns the imitation of a frame that the device at a place sends.
    pub(super) fn imitated(&self, place: NodeIndex, telegram: &Telegram) -> Option<Telegram> {
        let Imitation { of, original, channel, imitated } = self.imitation?;
        let is_original = (of, original) == (place, telegram.frame.cob_id);
        let frame = Frame::from_slice(imitated, telegram.frame.data()).filter(|_| is_original)?;
        Some(Telegram { channel, frame })
    }

    /// Sends a foreign frame if its time has come.
    pub(super) fn send_foreign(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let FaultKind::ForeignFrame { frame, period: Some(period) } = self.fault.kind else {
            return;
        };
        if self.sends.is_some_and(|sends| sends <= now) {
            out.extend(self.fault.target.bus().map(|channel| Telegram { channel, frame }));
            self.sends = Some(now + period);
        }
    }

    /// Returns the effect on a frame of a device; `None` where the fault does not apply to it.
    pub(super) fn effect(
        &mut self,
        device: &dyn Breakable,
        place: NodeIndex,
        direction: Direction,
        frame: &Frame,
    ) -> Option<Effect> {
        let FaultKind::Frames(FrameFault { selection, effect, extent }) = self.fault.kind else {
            return None;
        };
        if !self.fault.target.has(place) || self.is_spent() {
            return None;
        }
        let is_selected = match selection {
            Selection::All => true,
            Selection::Service(service) => device.cob_id(direction, service) == Some(frame.cob_id),
            Selection::CobId(cob_id) => cob_id == frame.cob_id,
        };
        if !is_selected {
            return None;
        }
        let is_affected = match extent {
            Extent::Always => true,
            Extent::Share(share) => self.random.unit() < share,
            Extent::First(count) => self.matched < count,
        };
        self.matched = self.matched.saturating_add(1);
        is_affected.then_some(effect)
    }

    /// Returns whether frames from or to the device at a place may be changed or imitated.
    pub(super) fn changes(&self, place: NodeIndex) -> bool {
        let is_of_frames = matches!(self.fault.kind, FaultKind::Frames(_)) && !self.is_spent();
        let is_imitated = self.imitation.is_some_and(|imitation| imitation.of == place);
        is_of_frames && self.fault.target.has(place) || self.is_disconnected(place) || is_imitated
    }

    /// Returns whether the fault has applied to as many frames as its `count`.
    pub(super) const fn is_spent(&self) -> bool {
        let FaultKind::Frames(FrameFault { extent: Extent::First(count), .. }) = self.fault.kind
        else {
            return false;
        };
        self.matched >= count
    }

    /// Returns the first frame of this COB-ID since the fault started.
    pub(super) fn first(&mut self, place: NodeIndex, direction: Direction, frame: Frame) -> Frame {
        let is_same = |kept: &&(NodeIndex, Direction, Frame)| {
            (kept.0, kept.1, kept.2.cob_id) == (place, direction, frame.cob_id)
        };
        if let Some((.., kept)) = self.frames.iter().find(is_same) {
            return *kept;
        }
        self.frames.push((place, direction, frame));
        frame
    }

    /// Returns the values that a drive measures.
    pub(super) fn sensed(&mut self, joint: Joint, sensed: MotorReading) -> MotorReading {
        let FaultKind::Sensor(fault) = self.fault.kind else { return sensed };
        if !self.fault.target.has(joint.into()) {
            return sensed;
        }
        match fault {
            SensorFault::PositionOffset(by) => {
                MotorReading { position: sensed.position + by, ..sensed }
            }
            SensorFault::PositionFrozen => {
                let kept = joint.entry_mut(&mut self.senses).get_or_insert(sensed);
                MotorReading { position: kept.position, velocity: 0.0, ..sensed }
            }
            SensorFault::TorqueScaled(factor) => {
                MotorReading { per_mille: sensed.per_mille * factor, ..sensed }
            }
        }
    }

    /// Returns the levels at the switch box's terminals.
    pub(super) fn inputs(&mut self, inputs: u8) -> u8 {
        let FaultKind::Contact(input, fault) = self.fault.kind else { return inputs };
        match fault {
            ContactFault::StuckHigh => inputs | input.bit(),
            ContactFault::StuckLow => inputs & !input.bit(),
            ContactFault::Bouncing => {
                if self.random.unit() < 0.5 {
                    inputs ^ input.bit()
                } else {
                    inputs
                }
            }
        }
    }
}
