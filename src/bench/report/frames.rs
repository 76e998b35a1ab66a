//! Frames of a log as text: those around a given time, and those of the boot.

use std::collections::BTreeMap;
use std::collections::VecDeque;
use std::io::BufRead;
use std::time::Duration;

use canopen::frame::Channel;
use canopen_tools::candump::{Content, Line};
use canopen_tools::decode::{Bus, Decoder, Message};
use canopen_tools::members;
use config::Config;
use telemetry::session::{NODE, WRENCH};
use units::time::Instant;

/// Number of lines searched for interfaces.
const FIRST_LINES: usize = 2_000;

/// Number of frames that are shown before a moment, and after it.
const SHOWN: [usize; 2] = [40, 12];

/// Number of lines of a boot that are searched, and of its events that are shown.
const BOOT_LINES: usize = 400_000;
const BOOT_EVENTS: usize = 250;

/// Returns the interfaces of the first lines of a log, in their order.
pub(crate) fn interfaces(log: impl BufRead) -> Vec<String> {
    let mut interfaces: Vec<String> = Vec::new();
    for line in log.lines().take(FIRST_LINES).map_while(Result::ok) {
        let Ok(line) = Line::parse(&line) else { continue };
        let is_bus = ![NODE.0, WRENCH.0].contains(&line.interface);
        if is_bus && interfaces.iter().all(|name| name != line.interface) {
            interfaces.push(line.interface.to_owned());
        }
    }
    interfaces
}

/// Returns the first stamp of a log, in µs.
pub(crate) fn first_us(log: impl BufRead) -> Option<u64> {
    let mut lines = log.lines().take(FIRST_LINES).map_while(Result::ok);
    lines.find_map(|line| Some(Line::parse(&line).ok()?.nanos / 1_000))
}

/// Decoder of a log's lines.
#[derive(Debug)]
pub(crate) struct Reader {
    decoder: Decoder,
    buses: Vec<(String, Bus)>,
    origin_us: u64,
}

/// Frame with its meaning as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FrameText {
    /// Time since time zero.
    pub(crate) at: Duration,
    pub(crate) interface: String,
    /// Identifier and bytes, as candump has them.
    pub(crate) frame: String,
    /// Kind and node.
    pub(crate) name: String,
    pub(crate) text: String,
}

impl Reader {
    pub(crate) fn new(config: Option<&Config>, interfaces: &[String], origin_us: u64) -> Self {
        let mut decoder = match config {
            Some(config) => Decoder::new(members::members(config), members::timing(config)),
            None => Decoder::generic(),
        };
        let channels = config.map(|config| config.channels()).unwrap_or_default();
        let buses = interfaces.iter().enumerate().map(|(place, name)| {
            let channel: Option<Channel> = channels.get(place).copied();
            (name.clone(), decoder.listen(channel))
        });
        let buses = buses.collect();
        Self { decoder, buses, origin_us }
    }

    /// Returns a data frame in words if `is_wanted`. Takes every frame, as a transfer has several.
    fn describe(
        &mut self,
        line: &Line<'_>,
        is_wanted: impl Fn(&Message<'_>) -> bool,
    ) -> Option<FrameText> {
        let (cob_id, data) = line.canopen()?;
        let (_, bus) = self.buses.iter().find(|(name, _)| name == line.interface)?;
        let at = Instant::from_micros((line.nanos / 1_000).saturating_sub(self.origin_us));
        let annotation = self.decoder.on_frame(*bus, Some(at), cob_id, data);
        if !is_wanted(&annotation.message) {
            return None;
        }
        let bytes: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        let remarks: String = annotation.remarks().map(|remark| format!("; {remark}")).collect();
        Some(FrameText {
            at: at.since(Instant::ZERO),
            interface: line.interface.to_owned(),
            frame: format!("{cob_id:03X}#{bytes}"),
            name: annotation.name().to_string(),
            text: format!("{annotation}{remarks}"),
        })
    }

    /// Returns the frames around a time since time zero.
    pub(crate) fn around(&mut self, log: impl BufRead, moment: Duration) -> Vec<FrameText> {
        let [before, after] = SHOWN;
        let mut frames = VecDeque::with_capacity(before + after);
        let mut later = 0;
        for line in log.lines().map_while(Result::ok) {
            let Ok(line) = Line::parse(&line) else { continue };
            let Some(frame) = self.describe(&line, |_| true) else { continue };
            later += usize::from(frame.at > moment);
            if later > after {
                break;
            }
            frames.push_back(frame);
            if later == 0 && frames.len() > before {
                frames.pop_front();
            }
        }
        frames.into()
    }

    /// Returns the events of a boot that ends at `end`: changes of nodes, emergencies, NMT; and the number of SDO frames.
    pub(crate) fn boot(&mut self, log: impl BufRead, end: Duration) -> Boot {
        let mut boot = Boot::default();
        for line in log.lines().map_while(Result::ok).take(BOOT_LINES) {
            let Ok(line) = Line::parse(&line) else { continue };
            let at = Duration::from_nanos(line.nanos)
                .saturating_sub(Duration::from_micros(self.origin_us));
            if at > end {
                break;
            }
            if matches!(line.content, Content::Data(_)) {
                *boot.frames.entry(line.interface.to_owned()).or_default() += 1;
            }
            if line.canopen().is_some_and(|(cob_id, _)| (0x581..=0x5FF).contains(&cob_id)) {
                boot.sdo_replies += 1;
            }
            let is_event = |message: &Message<'_>| match message {
                Message::Nmt(_) | Message::Emergency(_) | Message::Heartbeat(_, Some(_)) => true,
                Message::Sync { .. }
                | Message::Time(_)
                | Message::Pdo(..)
                | Message::OtherPdo(..)
                | Message::Sdo(_)
                | Message::Heartbeat(_, None)
                | Message::Lss(_)
                | Message::Malformed(_)
                | Message::Unknown => false,
            };
            if let Some(event) = self.describe(&line, is_event) {
                match boot.events.len() < BOOT_EVENTS {
                    true => boot.events.push(event),
                    false => boot.more += 1,
                }
            }
        }
        boot
    }
}

/// Events of a boot.
#[derive(Debug, Default)]
pub(crate) struct Boot {
    pub(crate) events: Vec<FrameText>,
    /// Number of events that are not kept.
    pub(crate) more: u64,
    /// Number of frames on each bus.
    pub(crate) frames: BTreeMap<String, u64>,
    /// Number of replies of SDO servers.
    pub(crate) sdo_replies: u64,
}
