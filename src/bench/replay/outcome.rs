//! Result of a replay: the extent of the comparison, and its end.

use std::fmt;

use crate::input_parts::PartError;
use inputs::Call;

/// Result of a replay so far.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Number of cycles whose frames were compared.
    pub cycles: u64,
    /// Number of frames that were compared.
    pub frames: u64,
    /// Number of the last cycle, as in `bus.log`: with those of boots, which have no line there. Zero before the first.
    pub last_cycle: u64,
    /// First cycle with a different intermediate of the control law, and the name of the first such intermediate. The frames
    /// may be equal nevertheless.
    pub intermediate: Option<(u64, &'static str)>,
    /// Reason of the end; `None` while the replay continues.
    pub end: Option<End>,
}

impl Outcome {
    /// Returns whether every compared frame was equal.
    pub const fn is_equal(&self) -> bool {
        !matches!(self.end, Some(End::Differs(_)))
    }

    /// Returns whether the replay reached the end of the recording.
    pub const fn is_complete(&self) -> bool {
        matches!(self.end, None | Some(End::Complete))
    }
}

/// Reason why a replay has ended.
#[derive(Debug)]
pub enum End {
    /// All recorded calls were replayed.
    Complete,
    /// Recording that ends inside of a call. Everything until then is equal.
    Cut(Place),
    /// Gap of this many inputs in the recording.
    Lost(Place, u64),
    /// Part of the inputs that is missing or invalid, so that the rest cannot be replayed.
    Unreadable(Place, PartError),
    /// Frames other than the recorded ones.
    Differs(Difference),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Complete => f.write_str("all as recorded"),
            Self::Cut(place) => write!(f, "as recorded; the recording ends {place}"),
            Self::Lost(place, inputs) => {
                let rest = "so the rest cannot be replayed";
                write!(f, "as recorded; {inputs} inputs are missing {place}, {rest}")
            }
            Self::Unreadable(place, error) => {
                write!(f, "as recorded; the rest cannot be read {place}: {error}")
            }
            Self::Differs(difference) => difference.fmt(f),
        }
    }
}

/// Place in a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Call of the node; `None` between two calls.
    pub call: Option<Call>,
    /// Number of this cycle, as in `bus.log`; elsewhere that of the cycle before, zero before the first.
    pub cycle: u64,
}

impl Place {
    /// Returns the first cycle whose frames in `bus.log` contain those of this place.
    pub const fn cycle_in_log(&self) -> u64 {
        let is_cycle = matches!(self.call, Some(Call::Cycle));
        if is_cycle { self.cycle } else { self.cycle.saturating_add(1) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.call {
            Some(Call::Cycle) => return write!(f, "in cycle {}", self.cycle),
            Some(Call::New) => "in the start ",
            Some(Call::BringUp | Call::BringUpUnpowered(_)) => "in the boot ",
            Some(Call::Request(_)) => "in the request ",
            Some(Call::Stop) => "in the stop ",
            None => "",
        };
        f.write_str(name)?;
        match self.cycle {
            0 => f.write_str("before the first cycle"),
            cycle => write!(f, "after cycle {cycle}"),
        }
    }
}

/// First call with other frames.
#[derive(Debug)]
pub struct Difference {
    /// Call of the node whose frames or steps differ.
    pub place: Place,
    /// Step of the node that the recorded one did not take; `None` if only frames differ.
    pub misstep: Option<String>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { place, misstep } = self;
        match misstep {
            Some(misstep) => write!(f, "{place} {misstep}"),
            None => write!(f, "other frames are sent {place}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use node::Request;

    #[test]
    fn place_is_named_by_its_call_and_the_number_in_the_log() {
        let shown = |call, cycle| Place { call, cycle }.to_string();
        assert_eq!(shown(Some(Call::Cycle), 4_257), "in cycle 4257");
        assert_eq!(shown(Some(Call::Request(Request::Arm)), 7), "in the request after cycle 7");
        assert_eq!(shown(Some(Call::BringUp), 0), "in the boot before the first cycle");
        assert_eq!(shown(None, 7), "after cycle 7");
        let in_log = |call| Place { call, cycle: 7 }.cycle_in_log();
        assert_eq!((in_log(Some(Call::Cycle)), in_log(Some(Call::Stop)), in_log(None)), (7, 8, 8));
    }
}
