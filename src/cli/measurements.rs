//! Torque measurements as CSV: a header, a line per sample, and comments that say where they come from.
//!
//! | column       | what                                                                     |
//! |--------------|--------------------------------------------------------------------------|
//! | `joint`      | its name; left out where there is only one                               |
//! | `per_mille`  | target torque, in ‰ of rated torque (6071h)                              |
//! | `torque_nm`  | what the joint exerted, in N·m; `force_n` of a sliding joint, in N       |
//! | `sweep`      | `up` or `down`: whether the command was rising; left out where unknown   |

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::controller::fit::Sample;
use crate::sim::rig::Reading;

/// Larger files are no measurements of a few joints, in bytes.
const LARGEST: u64 = 16 << 20;

/// All samples of one joint, in the order they were taken.
pub(super) struct Measured {
    /// Its name.
    pub(super) joint: String,
    /// Its samples.
    pub(super) samples: Vec<Sample>,
    /// N·m, or N where it slides.
    pub(super) unit: &'static str,
}

/// A whole file.
pub(super) struct Measurements {
    /// Its joints, in order of appearance.
    pub(super) joints: Vec<Measured>,
    /// Its comments, without the sign.
    pub(super) comments: Vec<String>,
}

/// Where the columns are.
struct Columns {
    joint: Option<usize>,
    per_mille: usize,
    torque: usize,
    sweep: Option<usize>,
    unit: &'static str,
}

/// Reads a file of measurements.
pub(super) fn read(path: &Path) -> Result<Measurements, Failure> {
    let at = |line: Option<u64>, reason: String| {
        let line = line.map_or_else(String::new, |line| format!(":{line}"));
        Failure::new(Kind::Configuration, format!("{}{line}: {reason}", path.display()))
    };
    let size = fs::metadata(path).map_err(|error| at(None, error.to_string()))?.len();
    if size > LARGEST {
        return Err(at(None, format!("larger than {} MiB", LARGEST >> 20)));
    }
    let text = fs::read_to_string(path).map_err(|error| at(None, error.to_string()))?;
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(&text);
    let comments = text.lines().filter_map(|line| line.trim_start().strip_prefix('#'));
    let comments = comments.map(|comment| comment.trim().to_owned()).collect();

    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let line_of = |error: &csv::Error| error.position().map(csv::Position::line);
    let header = reader.headers().map_err(|error| at(line_of(&error), error.to_string()))?.clone();
    let columns = columns(&header).map_err(|reason| at(None, reason))?;
    let mut joints: Vec<Measured> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| at(line_of(&error), error.to_string()))?;
        let line = record.position().map(csv::Position::line);
        let (joint, sample) = sample(&columns, &record).map_err(|reason| at(line, reason))?;
        match joints.iter_mut().find(|measured| measured.joint == joint) {
            Some(measured) => measured.samples.push(sample),
            None => joints.push(Measured { joint, samples: vec![sample], unit: columns.unit }),
        }
    }
    if joints.is_empty() {
        return Err(at(None, "no samples".to_owned()));
    }
    Ok(Measurements { joints, comments })
}

fn columns(header: &csv::StringRecord) -> Result<Columns, String> {
    let place = |name: &str| header.iter().position(|column| column == name);
    let known = ["joint", "per_mille", "torque_nm", "force_n", "sweep"];
    if let Some(unknown) = header.iter().find(|column| !known.contains(column)) {
        return Err(format!("column \"{unknown}\": there is {}", known.join(", ")));
    }
    let missing = |name: &str| format!("column {name} is missing");
    let (torque, unit) = match (place("torque_nm"), place("force_n")) {
        (Some(torque), None) => (torque, "N·m"),
        (None, Some(force)) => (force, "N"),
        (None, None) => return Err(missing("torque_nm")),
        (Some(_), Some(_)) => return Err("torque_nm and force_n exclude each other".to_owned()),
    };
    Ok(Columns {
        joint: place("joint"),
        per_mille: place("per_mille").ok_or_else(|| missing("per_mille"))?,
        torque,
        sweep: place("sweep"),
        unit,
    })
}

fn sample(columns: &Columns, record: &csv::StringRecord) -> Result<(String, Sample), String> {
    let number = |place: usize, name: &str| {
        let text = record.get(place).unwrap_or_default();
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| format!("{name}: \"{text}\" is not a finite number"))
    };
    let rising = match columns.sweep.and_then(|place| record.get(place)) {
        None | Some("up") => true,
        Some("down") => false,
        Some(other) => return Err(format!("sweep: \"{other}\": there is up, down")),
    };
    let joint = columns.joint.and_then(|place| record.get(place)).unwrap_or("joint");
    let sample = Sample {
        per_mille: number(columns.per_mille, "per_mille")?,
        torque: number(columns.torque, "torque_nm")?,
        rising,
    };
    Ok((joint.to_owned(), sample))
}

/// The file that a rig leaves behind.
pub(super) fn write(
    joint: &str,
    slides: bool,
    comments: &[String],
    readings: &[Reading],
) -> String {
    let mut text = String::new();
    for comment in comments {
        text.push_str(&format!("# {comment}\n"));
    }
    let torque = if slides { "force_n" } else { "torque_nm" };
    text.push_str(&format!("joint,sweep,per_mille,{torque}\n"));
    for Reading { per_mille, torque, rising } in readings {
        let sweep = if *rising { "up" } else { "down" };
        // Writing to a string cannot fail.
        writeln!(text, "{joint},{sweep},{per_mille},{torque:.6}").ok();
    }
    text
}
