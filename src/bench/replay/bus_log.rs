//! Frames of one cycle in `bus.log`, which ends each cycle with a line of `node0`.

use std::io::{self, BufRead};

use crate::recorder_line::RecorderLine;
use canopen::frame::{Channel, Frame, Telegram};
use canopen_tools::candump::{Content, Line};

/// Returns the frames between the line that ends the cycle before `first`, and the one that ends `last`.
pub(super) fn frames_of_cycles(
    log: impl BufRead,
    interfaces: &[String],
    first: u64,
    last: u64,
) -> io::Result<Vec<Telegram>> {
    let mut frames = Vec::new();
    for line in log.lines() {
        let line = line?;
        let Ok(line) = Line::parse(&line) else { continue };
        if let Some(ended) = cycle_ended(&line) {
            // The log has 32 bits of its number. Cycles of a boot have no line.
            if ended >= last & 0xFFFF_FFFF {
                break;
            }
            if ended < first & 0xFFFF_FFFF {
                frames.clear();
            }
        } else if let Some(telegram) = telegram(&line, interfaces) {
            frames.push(telegram);
        }
    }
    Ok(frames)
}

/// Returns the number of the cycle that a line ends.
fn cycle_ended(line: &Line<'_>) -> Option<u64> {
    let Content::Fd(_, data) = line.content else { return None };
    match RecorderLine::read(line, &data)? {
        RecorderLine::Wrench(_) => None,
        RecorderLine::Cycle { number, .. } => Some(number.into()),
    }
}

fn telegram(line: &Line<'_>, interfaces: &[String]) -> Option<Telegram> {
    let place = interfaces.iter().position(|name| name == line.interface)?;
    let channel = Channel(u8::try_from(place).ok()?);
    let cob_id = u16::try_from(line.id).ok().filter(|_| !line.is_extended)?;
    let frame = match line.content {
        Content::Data(data) => Frame::from_slice(cob_id, &data)?,
        Content::Remote(length) => Frame::remote(cob_id, length.unwrap_or(0)),
        Content::Fd(..) | Content::Error(_) => return None,
    };
    Some(Telegram { channel, frame })
}
