//! Text of the end of a replay, with the first differing frame.

use ::replay::{Difference, End, Replay, Session};
use canopen::frame::{Channel, TEXT_LENGTH, Telegram};
use run::exit::{Failure, Kind, OrFail};
use telemetry::manifest::Manifest;

/// Returns the end of a replay in words.
pub(super) fn end(session: &Session, replay: &Replay) -> Result<String, Failure> {
    match &replay.outcome().end {
        None => Ok(End::Complete.to_string()),
        Some(End::Differs(difference)) => differing(session, replay, difference),
        Some(end) => Ok(end.to_string()),
    }
}

/// Returns a difference in words, with its first frame.
fn differing(
    session: &Session,
    replay: &Replay,
    difference: &Difference,
) -> Result<String, Failure> {
    let cycle = difference.place.cycle_in_log();
    let recorded = session.frames_of_cycle(cycle).or_fail(Kind::File)?;
    let sent = replay.sent().iter().map(|(_, telegram)| telegram);
    let frame = first_difference(&recorded, sent.copied().collect()).map(|(was, is)| {
        let text = |telegram: Option<Telegram>| match telegram {
            Some(telegram) => shown(session.manifest(), &telegram),
            None => "nothing".to_owned(),
        };
        format!("; recorded {}, now {}", text(was), text(is))
    });
    Ok(format!("{difference}{}", frame.unwrap_or_default()))
}

/// Returns the first replayed frame that differs from the recording, with the recorded one.
fn first_difference(
    recorded: &[Telegram],
    sent: Vec<Telegram>,
) -> Option<(Option<Telegram>, Option<Telegram>)> {
    let mut recorded = recorded.to_vec();
    for telegram in sent {
        let key = |of: &Telegram| (of.channel, of.frame.cob_id);
        match recorded.iter().position(|it| key(it) == key(&telegram)) {
            Some(place) if recorded.get(place) == Some(&telegram) => _ = recorded.remove(place),
            Some(place) => return Some((recorded.get(place).copied(), Some(telegram))),
            None => return Some((None, Some(telegram))),
        }
    }
    None
}

/// Returns a frame as candump writes it.
fn shown(manifest: &Manifest, Telegram { channel: Channel(place), frame }: &Telegram) -> String {
    let interface = manifest.interfaces.get(usize::from(*place)).map_or("can?", String::as_str);
    let mut text = [0; TEXT_LENGTH];
    format!("{interface} {}", String::from_utf8_lossy(frame.text(&mut text)))
}
