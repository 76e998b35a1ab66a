//! Cycles of a `bus.log`, decoded by the layout of a configuration.
//!
//! Positions and targets are the newest on the wire at the end of the cycle. Torques after the line of their cycle, as in the
//! log of `demo`, are assigned to the next cycle.

use std::fmt;
use std::io::{self, BufRead};

use canopen::bits;
use canopen::drive::Statusword;
use canopen::frame::{Channel, Frame};
use canopen::object::Object;
use canopen_tools::candump::{Content, Line};
use canopen_tools::members::members;
use canopen_tools::object_text::Switches;
use canopen_tools::signals::{self, PdoFrame, Signal};
use config::Config;
use controller::calibration::Calibration;
use node::record::Mode;
use replay::recorder_line::RecorderLine;
use units::drive::{Counts, PerMille};
use units::numbering::Joint;
use units::spatial::Wrench;
use units::time::Instant;

/// Identifier of SYNC.
const SYNC: u16 = 0x80;

/// End of a cycle in the log.
#[derive(Clone, Copy, Debug)]
pub struct Ending {
    /// Number of the cycle.
    pub number: u64,
    /// Time of its first SYNC, or of its line if the log lacks the SYNC.
    pub at: Instant,
    /// Mode of the node at the end of the cycle.
    pub mode: Mode,
    /// Inputs of the switch box; `None` before its first frame.
    pub inputs: Option<u8>,
    /// Joints with a sample in time.
    pub sampled: [bool; 6],
    /// Wrench of the environment on the object at {S}, in N and N·m.
    pub f_s: Wrench,
}

/// State of drives and buses at the end of a cycle, from the frames alone.
#[derive(Clone, Debug)]
pub struct Wire {
    /// Joint positions, in rad or m; `None` until all drives have sent theirs.
    pub q: Option<[f64; 6]>,
    /// Target torques (6071h), in ‰ of rated torque; `None` until all were sent.
    pub targets: Option<[i16; 6]>,
    /// Joint torques of these targets according to the torque curves, in N·m or N.
    pub tau: Option<[f64; 6]>,
    /// Statuswords (6041h) of the drives; `None` until the first one.
    pub statuswords: [Option<Statusword>; 6],
    /// Load of each bus between its last two SYNCs, in percent of its bit rate.
    pub load_percent: Vec<f64>,
}

impl Wire {
    fn new(buses: usize) -> Self {
        Self {
            q: None,
            targets: None,
            tau: None,
            statuswords: [None; 6],
            load_percent: vec![0.0; buses],
        }
    }
}

/// Reader of the cycles of a log.
pub struct WireCycles<R> {
    log: R,
    interfaces: Vec<String>,
    /// Time zero of the session, in µs since 1970.
    origin_us: u64,
    line: Vec<u8>,
    layout: Option<Layout>,
    wire: Wire,
    /// Bits on each bus since its last SYNC, and the time of that.
    bits: Vec<(u32, Option<Instant>)>,
    f_s: Wrench,
    sync: Option<Instant>,
    /// Number of the last cycle.
    last: Option<u64>,
}

impl<R> fmt::Debug for WireCycles<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WireCycles").field("last", &self.last).finish_non_exhaustive()
    }
}

impl<R: BufRead> WireCycles<R> {
    /// Creates a reader of a log with these interfaces and this time zero, in µs since 1970. Without a configuration it does
    /// not decode the frames of the drives.
    pub fn new(log: R, interfaces: &[String], origin_us: u64, config: Option<&Config>) -> Self {
        Self {
            log,
            interfaces: interfaces.to_vec(),
            origin_us,
            line: Vec::new(),
            layout: config.map(Layout::from_config),
            wire: Wire::new(interfaces.len()),
            bits: vec![(0, None); interfaces.len()],
            f_s: Wrench::default(),
            sync: None,
            last: None,
        }
    }

    /// Returns the drives and buses at the end of the cycle that was read last.
    pub const fn wire(&self) -> &Wire {
        &self.wire
    }

    /// Reads up to the end of the next cycle; `None` at the end of the log. Lines that are not candump lines are skipped.
    ///
    /// # Errors
    /// Returns an error if the log cannot be read.
    pub fn read(&mut self) -> io::Result<Option<Ending>> {
        loop {
            self.line.clear();
            if self.log.read_until(b'\n', &mut self.line)? == 0 {
                return Ok(None);
            }
            let line = std::mem::take(&mut self.line);
            let text = std::str::from_utf8(&line).unwrap_or_default();
            let ending = Line::parse(text.trim_end()).ok().and_then(|line| self.take(&line));
            self.line = line;
            if let Some(ending) = ending {
                return Ok(Some(ending));
            }
        }
    }

    /// Takes a line; returns the end of a cycle.
    fn take(&mut self, line: &Line<'_>) -> Option<Ending> {
        let at = Instant::from_micros((line.nanos / 1_000).saturating_sub(self.origin_us));
        match line.content {
            Content::Data(data) => self.frame(line, at, &data),
            Content::Fd(_, data) => match RecorderLine::read(line, &data)? {
                RecorderLine::Wrench(components) => self.f_s = Wrench::from_components(components),
                RecorderLine::Cycle { mode, inputs, sampled, number } => {
                    return Some(self.ending(at, mode, inputs, sampled, number));
                }
            },
            Content::Remote(_) | Content::Error(_) => {}
        }
        None
    }

    fn frame(&mut self, line: &Line<'_>, at: Instant, data: &[u8]) {
        let place = self.interfaces.iter().position(|name| name == line.interface);
        let Some((place, cob_id)) = place.zip(u16::try_from(line.id).ok()) else { return };
        let Some(frame) = Frame::from_slice(cob_id, data) else { return };
        self.measure(place, &frame, at);
        if let (Some(layout), Ok(place)) = (&mut self.layout, u8::try_from(place)) {
            layout.take(Channel(place), cob_id, data, &mut self.wire.statuswords);
        }
    }

    /// Adds a frame to the load of its bus; each SYNC ends a measurement.
    fn measure(&mut self, place: usize, frame: &Frame, at: Instant) {
        let Some((sum, since)) = self.bits.get_mut(place) else { return };
        *sum += bits::exact(frame);
        if frame.cob_id != SYNC {
            return;
        }
        self.sync = self.sync.or(Some(at));
        let (sum, since) = (std::mem::take(sum), since.replace(at));
        let rate = self.layout.as_ref().and_then(|layout| layout.bit_rates.get(place));
        let load = self.wire.load_percent.get_mut(place);
        if let (Some(since), Some(rate), Some(load)) = (since, rate, load) {
            let capacity = at.since(since).as_secs_f64() * f64::from(*rate);
            *load = if capacity > 0.0 { 100.0 * f64::from(sum) / capacity } else { 0.0 };
        }
    }

    fn ending(
        &mut self,
        at: Instant,
        mode: Mode,
        inputs: Option<Switches>,
        sampled: u8,
        number: u32,
    ) -> Ending {
        let at = self.sync.take().unwrap_or(at);
        let number = unwrapped(number, self.last.unwrap_or(0));
        self.last = Some(number);
        self.layout.iter().for_each(|layout| layout.update(&mut self.wire));
        let sampled = std::array::from_fn(|joint| sampled >> joint & 1 == 1);
        let inputs = inputs.map(|Switches(bits)| bits);
        Ending { number, at, mode, inputs, sampled, f_s: self.f_s }
    }
}

/// Returns the number of a cycle from the 32 bits in the log, and the number of the last cycle.
fn unwrapped(low: u32, last: u64) -> u64 {
    let high = last & !u64::from(u32::MAX);
    let same = high | u64::from(low);
    // A large step backwards is an overflow of the 32 bits.
    if same + (1 << 31) < last { same + (1 << 32) } else { same }
}

/// Signals of the drives in the PDOs of a configuration, and their last raw values.
#[derive(Debug)]
struct Layout {
    frames: Vec<PdoFrame>,
    /// Joint of each member.
    joints: Vec<Option<Joint>>,
    calibration: Calibration<6>,
    bit_rates: Vec<u32>,
    counts: [Option<Counts>; 6],
    targets: [Option<PerMille>; 6],
}

impl Layout {
    fn from_config(config: &Config) -> Self {
        let members = members(config);
        let joint = |place: usize| {
            let member = members.get(place)?;
            let is_its = |joint: &&config::JointParameters| {
                (joint.channel, joint.node) == (member.channel, member.node())
            };
            Joint::at(config.joints.iter().position(|joint| is_its(&joint))?)
        };
        let mut frames = signals::frames(&members);
        for frame in &mut frames {
            frame.signals.retain(|signal| Self::OBJECTS.contains(&signal.object));
        }
        frames.retain(|frame| !frame.signals.is_empty());
        Self {
            frames,
            joints: (0..members.len()).map(joint).collect(),
            calibration: config.controller.calibration,
            bit_rates: config.buses.iter().map(|bus| bus.bitrate).collect(),
            counts: [None; 6],
            targets: [None; 6],
        }
    }

    const OBJECTS: [Object; 3] =
        [Object::STATUSWORD, Object::POSITION_ACTUAL, Object::TARGET_TORQUE];

    fn take(
        &mut self,
        channel: Channel,
        cob_id: u16,
        data: &[u8],
        statuswords: &mut [Option<Statusword>; 6],
    ) {
        let is_its = |frame: &&PdoFrame| (frame.channel, frame.cob_id) == (channel, cob_id);
        let Some(frame) = self.frames.iter().find(is_its) else { return };
        let mut padded = [0; 8];
        padded.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        for signal in frame.signals.iter().filter(|signal| signal.is_in(data.len())) {
            let Some(joint) = self.joints.get(signal.member).copied().flatten() else { continue };
            let raw = Signal::raw(signal, padded);
            match signal.object {
                Object::POSITION_ACTUAL => {
                    *joint.entry_mut(&mut self.counts) = i32::try_from(raw).ok().map(Counts);
                }
                Object::TARGET_TORQUE => {
                    *joint.entry_mut(&mut self.targets) = i16::try_from(raw).ok().map(PerMille);
                }
                _ => {
                    let word = u16::try_from(raw & 0xFFFF).ok().map(Statusword);
                    *joint.entry_mut(statuswords) = word;
                }
            }
        }
    }

    /// Sets positions, targets and torques, each where all joints have one.
    fn update(&self, wire: &mut Wire) {
        let (counts, targets) = (all(&self.counts), all(&self.targets));
        let sent = targets.map(|targets| targets.map(|PerMille(target)| target));
        wire.q = counts.map(|counts| self.calibration.positions(&counts).into());
        // The inverse of a torque curve costs more than the rest of a cycle.
        if sent != wire.targets {
            wire.tau = targets.map(|targets| self.calibration.torques(&targets).into());
        }
        wire.targets = sent;
    }
}

/// Returns the values of all joints, unless one is missing.
fn all<T: Copy>(values: &[Option<T>; 6]) -> Option<[T; 6]> {
    let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = *values else { return None };
    Some([a, b, c, d, e, f])
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;
    use std::path::Path;

    use super::*;
    use controller::JointVector;

    fn kraft_like() -> Config {
        Config::load(Path::new("config/kraft_like.toml")).unwrap()
    }

    #[test]
    fn cycle_number_of_32_bits_goes_on_after_its_wrap() {
        assert_eq!(unwrapped(7, 0), 7);
        assert_eq!(unwrapped(0, u64::from(u32::MAX)), 1 << 32);
        assert_eq!(unwrapped(5, (1 << 32) + 4), (1 << 32) + 5);
    }

    #[test]
    fn cycle_has_time_of_its_sync_and_values_of_its_frames() {
        let config = kraft_like();
        let mut log = String::from("(100.000000) vcan0 080#\n");
        for joint in 1..=6 {
            writeln!(log, "(100.000{joint}00) vcan0 18{joint}#00000000").unwrap();
        }
        log.push_str("not a line\n(100.000700) vcan0 201#640000000000\n(100.000800) vcan0 204#000000000000\n");
        log.push_str("(100.000900) wrench0 18FF0000##0");
        for component in [1.0_f64, 0.0, -2.0, 0.0, 0.0, 0.5] {
            component.to_le_bytes().iter().for_each(|byte| write!(log, "{byte:02X}").unwrap());
        }
        log.push_str("\n(100.000900) node0 18FF0001##003FF3F002A000000\n");
        let interfaces = ["vcan0".to_owned()];
        let mut cycles = WireCycles::new(log.as_bytes(), &interfaces, 99_000_000, Some(&config));
        let ending = cycles.read().unwrap().unwrap();
        assert_eq!((ending.number, ending.mode), (42, Mode::Engaged));
        assert_eq!(ending.at, Instant::from_micros(1_000_000));
        assert_eq!((ending.inputs, ending.sampled), (None, [true; 6]));
        assert_eq!(ending.f_s, Wrench::from_components([1.0, 0.0, -2.0, 0.0, 0.0, 0.5]));
        let wire = cycles.wire();
        let targets = wire.targets.unwrap();
        assert_eq!(targets, [100, 0, 0, 0, 0, 0]);
        let expected = config.controller.calibration.torques(&targets.map(PerMille));
        assert_eq!(JointVector::from(wire.tau.unwrap()), expected);
        let expected = config.controller.calibration.positions(&[Counts(0); 6]);
        assert_eq!(JointVector::from(wire.q.unwrap()), expected);
        assert!(cycles.read().unwrap().is_none());
    }

    #[test]
    fn load_is_the_share_of_the_bits_between_two_syncs() {
        let config = kraft_like();
        let node = "(0.001900) node0 18FF0001##003FF3F002A000000\n";
        let log = format!(
            "(0.000000) vcan0 080#\n(0.000400) vcan0 181#00000000\n(0.001000) vcan0 080#\n{node}"
        );
        let interfaces = ["vcan0".to_owned()];
        let mut cycles = WireCycles::new(log.as_bytes(), &interfaces, 0, Some(&config));
        cycles.read().unwrap().unwrap();
        let frames = [Frame::new(0x80, []), Frame::new(0x181, [0; 4])];
        let bits: u32 = frames.iter().map(bits::exact).sum();
        let expected = f64::from(bits) / 10.0;
        assert!((cycles.wire().load_percent[0] - expected).abs() < 1e-9);
    }
}
