//! Lines that the session recorder writes between the frames of the buses: see `telemetry::session`.

use std::fmt;

use canopen_tools::candump::Line;
use canopen_tools::fixed::FixedDecimal;
use canopen_tools::object_text::Switches;
use node::record::Mode;
use telemetry::session::{NODE, WRENCH};

/// Line of the session recorder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecorderLine {
    /// Wrench on the object at {S}: force in N, moment in N·m.
    Wrench([f64; 6]),
    /// End of a cycle.
    Cycle {
        /// Mode of the node.
        mode: Mode,
        /// Switch inputs; `None` before the first frame of the switch box.
        inputs: Option<Switches>,
        /// Bit mask of the joints whose samples were received.
        sampled: u8,
        /// Number of the cycle.
        number: u32,
    },
}

impl RecorderLine {
    /// Parses a line; `None` if the recorder has not written it.
    pub fn read(line: &Line<'_>, data: &[u8]) -> Option<Self> {
        if (line.interface, line.id) == WRENCH {
            let (numbers, rest) = data.as_chunks::<8>();
            let numbers: &[[u8; 8]; 6] = numbers.try_into().ok().filter(|_| rest.is_empty())?;
            return Some(Self::Wrench(numbers.map(f64::from_le_bytes)));
        }
        if (line.interface, line.id) != NODE {
            return None;
        }
        let &[mode, inputs, sampled, _, c0, c1, c2, c3] = data else { return None };
        let mode = *Mode::ALL.get(usize::from(mode))?;
        let inputs = (inputs != SILENT).then_some(Switches(inputs));
        Some(Self::Cycle { mode, inputs, sampled, number: u32::from_le_bytes([c0, c1, c2, c3]) })
    }

    /// Returns the name of the line's kind.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Wrench(_) => "wrench",
            Self::Cycle { .. } => "cycle",
        }
    }
}

/// Inputs byte before the first frame of the switch box.
const SILENT: u8 = 0xFF;

impl fmt::Display for RecorderLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wrench([forces @ .., a, b, c]) => {
                let [x, y, z] = forces.map(|force| FixedDecimal::new(force, 8, 3));
                let [a, b, c] = [*a, *b, *c].map(|moment| FixedDecimal::new(moment, 8, 4));
                write!(f, "{x} {y} {z} N  {a} {b} {c} N·m")
            }
            Self::Cycle { mode, inputs, sampled, number } => {
                write!(f, "{number} {mode}")?;
                match inputs {
                    None => f.write_str("  switch box silent")?,
                    Some(switches) => write!(f, "  {switches}")?,
                }
                if *sampled == ALL {
                    Ok(())
                } else {
                    write!(f, "  samples of {}", Joints(*sampled))
                }
            }
        }
    }
}

/// Bit mask of the six joints.
const ALL: u8 = 0b11_1111;

/// Bit mask shown as joint numbers from 1, base first.
struct Joints(u8);

impl fmt::Display for Joints {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut lead = "";
        for joint in (0..8).filter(|bit| self.0 & 1 << bit != 0) {
            write!(f, "{lead}{}", joint + 1)?;
            lead = " ";
        }
        f.write_str(if lead.is_empty() { "none" } else { "" })
    }
}
