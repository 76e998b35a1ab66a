//! Text output of `decode`: in columns the unchanged line, the frame's name, its meaning, and its anomalies.

use std::fmt::Write;

use crate::decode::meaning::Meaning;
use crate::decode::timestamps::GoesBack;
use canopen_tools::decode::Decoder;

/// Positions and widths of the columns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns {
    /// Position of the annotation: behind the longest classical frame so far.
    annotation: usize,
    /// Width of the names.
    name: usize,
    is_coloured: bool,
}

/// Maximum line length that moves the annotation column; longer lines overrun it.
const MAX_LINE_WIDTH: usize = 100;

/// Minimum width of the names: that of `heartbeat node 127`.
const MIN_NAME_WIDTH: usize = 18;

impl Columns {
    /// Returns columns wide enough for the names of a decoder.
    pub(super) fn new(decoder: &Decoder, is_coloured: bool) -> Self {
        let frames = decoder.frames().iter().map(|frame| frame.name.len());
        let members = decoder.members().iter().map(|member| "heartbeat ".len() + member.name.len());
        let name = frames.chain(members).max().unwrap_or_default().max(MIN_NAME_WIDTH);
        Self { annotation: 0, name, is_coloured }
    }

    /// Widens the first column to eight data bytes after the identifier of `raw`.
    fn fit(&mut self, raw: &str) {
        let end = match raw.bytes().position(|byte| matches!(byte, b'#' | b']' | b'}')) {
            Some(hash) if raw.as_bytes().get(hash) == Some(&b'#') => {
                hash + "#0011223344556677".len()
            }
            Some(bracket) => bracket + "]  00 11 22 33 44 55 66 77".len(),
            None => raw.len(),
        };
        self.annotation = self.annotation.max(end.max(raw.len().min(MAX_LINE_WIDTH)) + 2);
    }
}

const DIM: &str = "\x1b[2m";
const CYAN: &str = "\x1b[36m";
const RED: &str = "\x1b[1;31m";
const PLAIN: &str = "\x1b[0m";

/// Replaces the content of `to` by the output line.
pub(super) fn line(
    raw: &str,
    meaning: &Meaning<'_>,
    back: Option<GoesBack>,
    columns: &mut Columns,
    to: &mut String,
) {
    if !matches!(meaning, Meaning::RecorderLine(_)) {
        columns.fit(raw);
    }
    to.clear();
    // Writing into a String cannot fail.
    write(raw, meaning, back, columns, to).ok();
    to.truncate(to.trim_end().len());
    to.push('\n');
}

/// Appends this many spaces.
fn push_spaces(to: &mut String, count: usize) {
    const SPACES: &str = "                                                                ";
    let mut left = count;
    while left > 0 {
        let part = SPACES.get(..left).unwrap_or(SPACES);
        to.push_str(part);
        left -= part.len();
    }
}

fn write(
    raw: &str,
    meaning: &Meaning<'_>,
    back: Option<GoesBack>,
    columns: &Columns,
    to: &mut String,
) -> std::fmt::Result {
    let Columns { annotation: column, name: width, is_coloured } = *columns;
    let colour = |colour: &'static str| if is_coloured { colour } else { "" };
    let plain = colour(PLAIN);
    let gap = column.saturating_sub(raw.len()).max(2);
    [colour(DIM), raw, plain].into_iter().for_each(|part| to.push_str(part));
    push_spaces(to, gap);
    to.push_str(colour(CYAN));
    let start = to.len();
    match meaning {
        Meaning::Frame(annotation) => write!(to, "{}", annotation.name())?,
        Meaning::RecorderLine(pseudo) => to.push_str(pseudo.name()),
        Meaning::Error(_) => to.push_str("error frame"),
        Meaning::Other(what) => to.push_str(what),
    }
    let gap = width.saturating_sub(to.len() - start) + 1;
    to.push_str(plain);
    push_spaces(to, gap);
    match meaning {
        Meaning::Frame(annotation) if annotation.is_alarming() => {
            write!(to, "{}{annotation}{plain}", colour(RED))?;
        }
        Meaning::Frame(annotation) => write!(to, "{annotation}")?,
        Meaning::RecorderLine(pseudo) => write!(to, "{pseudo}")?,
        Meaning::Error(error) => write!(to, "{}{error}{plain}", colour(RED))?,
        Meaning::Other(_) => {}
    }
    let mut lead = "  ! ";
    if let Some(back) = back {
        write!(to, "{}{lead}{back}{plain}", colour(RED))?;
        lead = ", ";
    }
    let Meaning::Frame(annotation) = meaning else { return Ok(()) };
    for remark in annotation.remarks() {
        write!(to, "{}{lead}{remark}{plain}", colour(RED))?;
        lead = ", ";
    }
    Ok(())
}
