//! A fault while it lasts: which frames it strikes, and what it has kept of before.

use crate::drivetrain::Sensed;
use crate::fault::Devices;
use crate::fault::breakable::Breakable;
use crate::fault::breakable::Way;
use crate::random::SplitMix;
use crate::scenario::fault::Contact;
use crate::scenario::fault::Cut;
use crate::scenario::fault::Fault;
use crate::scenario::fault::Frames;
use crate::scenario::fault::Kind;
use crate::scenario::fault::Often;
use crate::scenario::fault::Selection;
use crate::scenario::fault::Sense;
use crate::scenario::fault::Service;
use crate::scenario::fault::Treatment;
use crate::scenario::fault::Whom;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use units::numbering::Joint;
use units::numbering::NodeIndex;
use units::time::Instant;

/// One fault that has begun and is not over.
#[derive(Clone, Debug)]
pub(super) struct Running {
    pub(super) fault: Fault,
    pub(super) until: Option<Instant>,
    /// When a stranger speaks next.
    pub(super) speaks: Option<Instant>,
    /// Which places are off their bus by it.
    cut_off: [bool; 7],
    /// Whose words are said under whose identifier.
    voice: Option<Voice>,
    /// Chance of its own, so that no fault changes another's.
    random: SplitMix,
    struck: u32,
    frames: Vec<(NodeIndex, Way, Frame)>,
    senses: [Option<Sensed>; 6],
}

/// One device's words under another one's identifier.
#[derive(Clone, Copy, Debug)]
struct Voice {
    /// Whose words.
    of: NodeIndex,
    /// Under which identifier it says them itself.
    said: u16,
    /// On which bus they are said again.
    channel: Channel,
    /// Under which identifier.
    again: u16,
}

impl Whom {
    /// Whether the device at a place is befallen.
    pub(super) fn has(self, place: NodeIndex) -> bool {
        match self {
            Self::Joint(joint) => place.joint() == Some(joint),
            Self::Drives => place.joint().is_some(),
            Self::Switches => place.joint().is_none(),
            Self::Bus(_) | Self::Link => false,
        }
    }

    /// The bus that is befallen as a whole.
    pub(super) const fn bus(self) -> Option<Channel> {
        match self {
            Self::Bus(channel) => Some(channel),
            Self::Joint(_) | Self::Drives | Self::Switches | Self::Link => None,
        }
    }
}

impl Running {
    /// A fault that begins at `now`, with chances of `seed`.
    pub(super) fn new(fault: Fault, now: Instant, seed: u64) -> Self {
        Self {
            fault,
            until: fault.lasts.map(|span| now + span),
            speaks: None,
            cut_off: [false; 7],
            voice: None,
            random: SplitMix::new(seed),
            struck: 0,
            frames: Vec::new(),
            senses: [None; 6],
        }
    }

    /// Devices are off their bus: those it befalls, or for a wire also those behind them.
    pub(super) fn cut(&mut self, cut: Cut, devices: &mut Devices<'_>) {
        let mut ended: [Option<Channel>; 7] = [None; 7];
        for (place, device) in NodeIndex::each(devices) {
            let is_befallen = self.fault.whom.has(place);
            let channel = Some(device.channel());
            let is_behind = cut == Cut::Wire && ended.contains(&channel);
            if let (true, Some(end)) = (is_befallen, ended.get_mut(place.0)) {
                *end = channel;
            }
            if let (true, Some(is_cut_off)) =
                (is_befallen || is_behind, self.cut_off.get_mut(place.0))
            {
                *is_cut_off = true;
                if cut == Cut::Plug {
                    device.switch_off();
                }
            }
        }
    }

    /// Whether the device at a place is off its bus by this fault.
    pub(super) fn is_cut_off(&self, place: NodeIndex) -> bool {
        self.cut_off.get(place.0).is_some_and(|is_cut_off| *is_cut_off)
    }

    /// From now on what joint `by` says with `service` is said again as if by whom this befalls.
    pub(super) fn impersonate(&mut self, by: Joint, service: Service, devices: &Devices<'_>) {
        let says = |place: NodeIndex| {
            let device = devices.get(place.0)?;
            Some((device.channel(), device.cob_id(Way::Said, service)?))
        };
        let mut places = NodeIndex::each(devices).map(|(place, _)| place);
        let befallen = places.find(|place| self.fault.whom.has(*place));
        let of = by.into();
        if let (Some((_, said)), Some((channel, again))) = (says(of), befallen.and_then(says)) {
            self.voice = Some(Voice { of, said, channel, again });
        }
    }

    /// What is said again of what the device at a place says.
    pub(super) fn again(&self, place: NodeIndex, telegram: &Telegram) -> Option<Telegram> {
        let voice = self.voice?;
        let is_said = (voice.of, voice.said) == (place, telegram.frame.cob_id);
        let frame = Frame::from_slice(voice.again, telegram.frame.data()).filter(|_| is_said)?;
        Some(Telegram { channel: voice.channel, frame })
    }

    /// A stranger says what is due.
    pub(super) fn speak(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let Kind::Stranger { frame, every: Some(every) } = self.fault.kind else { return };
        if self.speaks.is_some_and(|speaks| speaks <= now) {
            out.extend(self.fault.whom.bus().map(|channel| Telegram { channel, frame }));
            self.speaks = Some(now + every);
        }
    }

    /// What happens to a frame of a device, if anything does.
    pub(super) fn strike(
        &mut self,
        device: &dyn Breakable,
        place: NodeIndex,
        way: Way,
        frame: &Frame,
    ) -> Option<Treatment> {
        let Kind::Frames(Frames { selection, treatment, often }) = self.fault.kind else {
            return None;
        };
        if !self.fault.whom.has(place) || self.is_spent() {
            return None;
        }
        let is_selected = match selection {
            Selection::All => true,
            Selection::Service(service) => device.cob_id(way, service) == Some(frame.cob_id),
            Selection::CobId(cob_id) => cob_id == frame.cob_id,
        };
        if !is_selected {
            return None;
        }
        let is_struck = match often {
            Often::Always => true,
            Often::Share(share) => self.random.unit() < share,
            Often::First(count) => self.struck < count,
        };
        self.struck = self.struck.saturating_add(1);
        is_struck.then_some(treatment)
    }

    /// Returns whether the fault has applied to as many frames as its `count`.
    pub(super) const fn is_spent(&self) -> bool {
        match self.fault.kind {
            Kind::Frames(Frames { often: Often::First(count), .. }) => self.struck >= count,
            Kind::Frames(_)
            | Kind::Cut(_)
            | Kind::Impersonated { .. }
            | Kind::Trouble(_)
            | Kind::Sense(_)
            | Kind::Contact(..)
            | Kind::Stranger { .. }
            | Kind::Link(_) => false,
        }
    }

    /// The first frame of this identifier since the fault began.
    pub(super) fn first(&mut self, place: NodeIndex, way: Way, frame: Frame) -> Frame {
        let is_same = |kept: &&(NodeIndex, Way, Frame)| {
            (kept.0, kept.1, kept.2.cob_id) == (place, way, frame.cob_id)
        };
        if let Some((.., kept)) = self.frames.iter().find(is_same) {
            return *kept;
        }
        self.frames.push((place, way, frame));
        frame
    }

    /// What a drive senses of its motor.
    pub(super) fn sensed(&mut self, joint: Joint, sensed: Sensed) -> Sensed {
        let Kind::Sense(sense) = self.fault.kind else { return sensed };
        if !self.fault.whom.has(joint.into()) {
            return sensed;
        }
        match sense {
            Sense::EncoderOff(by) => Sensed { position: sensed.position + by, ..sensed },
            Sense::EncoderFrozen => {
                let kept = joint.entry_mut(&mut self.senses).get_or_insert(sensed);
                Sensed { position: kept.position, velocity: 0.0, ..sensed }
            }
            Sense::TorqueScaled(times) => Sensed { per_mille: sensed.per_mille * times, ..sensed },
        }
    }

    /// The levels at the switch box's terminals.
    pub(super) fn inputs(&mut self, inputs: u8) -> u8 {
        let Kind::Contact(input, contact) = self.fault.kind else { return inputs };
        match contact {
            Contact::StuckHigh => inputs | input.bit(),
            Contact::StuckLow => inputs & !input.bit(),
            Contact::Bounces => {
                if self.random.unit() < 0.5 {
                    inputs ^ input.bit()
                } else {
                    inputs
                }
            }
        }
    }
}
