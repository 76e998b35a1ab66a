//! A line for people: the line as it was, what it is, what it says, what is wrong; in columns.

use std::fmt::Write;

use crate::cli::decode::Said;
use crate::cli::decode::stamps::GoesBack;
use canopen_tools::decode::Decoder;

/// Where columns begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns {
    /// Annotations; as far right as the longest classical frame so far would need.
    annotation: usize,
    /// How wide the names are.
    name: usize,
    is_coloured: bool,
}

/// Longer lines push what is behind them to the right, but not what is behind the others.
const LONGEST: usize = 100;

/// The width of `heartbeat node 127`.
const NARROWEST: usize = 18;

impl Columns {
    /// For the names of a decoder.
    pub(super) fn new(decoder: &Decoder, is_coloured: bool) -> Self {
        let frames = decoder.frames().iter().map(|frame| frame.name.len());
        let members = decoder.members().iter().map(|member| "heartbeat ".len() + member.name.len());
        let name = frames.chain(members).max().unwrap_or_default().max(NARROWEST);
        Self { annotation: 0, name, is_coloured }
    }

    /// Makes room for eight bytes behind the identifier of `raw`.
    fn fit(&mut self, raw: &str) {
        let end = match raw.find(['#', ']', '}']) {
            Some(hash) if raw.as_bytes().get(hash) == Some(&b'#') => {
                hash + "#0011223344556677".len()
            }
            Some(bracket) => bracket + "]  00 11 22 33 44 55 66 77".len(),
            None => raw.len(),
        };
        self.annotation = self.annotation.max(end.max(raw.len().min(LONGEST)) + 2);
    }
}

const DIM: &str = "\x1b[2m";
const CYAN: &str = "\x1b[36m";
const RED: &str = "\x1b[1;31m";
const PLAIN: &str = "\x1b[0m";

/// Writes a line into `to`, whatever was there.
pub(super) fn line(
    raw: &str,
    said: &Said<'_>,
    back: Option<GoesBack>,
    columns: &mut Columns,
    to: &mut String,
) {
    if !matches!(said, Said::Pseudo(_)) {
        columns.fit(raw);
    }
    to.clear();
    // Writing into a String cannot fail.
    write(raw, said, back, columns, to).ok();
    to.truncate(to.trim_end().len());
    to.push('\n');
}

fn write(
    raw: &str,
    said: &Said<'_>,
    back: Option<GoesBack>,
    columns: &Columns,
    to: &mut String,
) -> std::fmt::Result {
    let Columns { annotation: column, name: width, is_coloured } = *columns;
    let colour = |colour: &'static str| if is_coloured { colour } else { "" };
    let plain = colour(PLAIN);
    let gap = column.saturating_sub(raw.len()).max(2);
    write!(to, "{}{raw}{plain}{:gap$}{}", colour(DIM), "", colour(CYAN))?;
    let start = to.len();
    match said {
        Said::Frame(annotation) => write!(to, "{}", annotation.name())?,
        Said::Pseudo(pseudo) => to.push_str(pseudo.name()),
        Said::Error(_) => to.push_str("error frame"),
        Said::Other(what) => to.push_str(what),
    }
    let gap = width.saturating_sub(to.len() - start) + 1;
    write!(to, "{plain}{:gap$}", "")?;
    match said {
        Said::Frame(annotation) if annotation.is_alarming() => {
            write!(to, "{}{annotation}{plain}", colour(RED))?;
        }
        Said::Frame(annotation) => write!(to, "{annotation}")?,
        Said::Pseudo(pseudo) => write!(to, "{pseudo}")?,
        Said::Error(error) => write!(to, "{}{error}{plain}", colour(RED))?,
        Said::Other(_) => {}
    }
    let mut lead = "  ! ";
    if let Some(back) = back {
        write!(to, "{}{lead}{back}{plain}", colour(RED))?;
        lead = ", ";
    }
    let Said::Frame(annotation) = said else { return Ok(()) };
    for remark in annotation.remarks() {
        write!(to, "{}{lead}{remark}{plain}", colour(RED))?;
        lead = ", ";
    }
    Ok(())
}
