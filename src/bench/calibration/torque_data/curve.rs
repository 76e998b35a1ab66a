//! Load cell readings over targets of joints at rest: input of the fit of a torque curve (paper, 4.2).
//!
//! ```text
//! # load cell 20 N on a lever arm of 300 mm, 2026-03-02        comments: provenance of the data
//! joint,direction,per_mille,torque_nm                          column names, in any order
//! azimuth,up,120,0.883
//! ```
//!
//! | column      | content                                                                       |
//! |-------------|------------------------------------------------------------------------------|
//! | `joint`     | name or number of the joint                                                  |
//! | `direction` | direction of the torque change: `up` or `+1` when rising, `down` or `-1`     |
//! | `per_mille` | target torque (6071h) in ‰ of rated torque, an integer                       |
//! | `torque_nm` | measured joint torque in N·m; `force_n` in N for prismatic joints            |
//! | `date`      | date of the measurement, optional, any text                                  |

use std::fmt;
use std::path::Path;

use crate::fit::Sample;
use crate::torque_data::readings::{self, Readings};
use config::Invalid;
use config::files::Files;
use config::problem;
use config::trust::Trust;

/// Readings of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TorqueData {
    /// Comment lines, without `#`.
    pub provenance: Vec<String>,
    /// Distinct dates, in order of appearance.
    pub dates: Vec<String>,
    /// Readings are forces of prismatic joints in N, not torques in N·m.
    pub is_force: bool,
    /// Joints, in order of appearance.
    pub joints: Vec<JointReadings>,
}

/// Load cell readings of a joint at rest, for its torque curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointReadings {
    /// Name or number of the joint, as written.
    pub joint: String,
    /// Readings, at least one.
    pub samples: Vec<Sample>,
    /// Line of each reading, from 1; empty without a file.
    pub lines: Vec<usize>,
}

impl TorqueData {
    /// Reads a file.
    ///
    /// # Errors
    /// Returns the first 20 problems of the file, with line and column.
    pub fn load(file: &Path) -> Result<Self, Invalid> {
        Self::parse(file, &problem::text(&Files::on_disk(Trust::Any), file)?)
    }

    /// Parses `text`, the content of `file`.
    ///
    /// # Errors
    /// Returns the first 20 problems of the text, with line and column.
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        let mut readings = Readings::new(file, text);
        let mut data = Self::default();
        if let Some(columns) = header(&mut readings) {
            data.is_force = columns.contains(&Column::Force);
            for row in readings.rows(columns.len()) {
                data.add(parse_row(&mut readings, &columns, &row));
            }
        }
        data.provenance = std::mem::take(&mut readings.comments);
        let is_empty = data.joints.is_empty();
        readings.finish(data, is_empty)
    }

    fn add(&mut self, row: Option<CurveReading>) {
        let Some(CurveReading { line, joint, date, sample }) = row else { return };
        if let Some(date) = date.filter(|date| !self.dates.contains(date)) {
            self.dates.push(date);
        }
        match self.joints.iter_mut().find(|measured| measured.joint == joint) {
            Some(measured) => {
                measured.samples.push(sample);
                measured.lines.push(line);
            }
            None => {
                self.joints.push(JointReadings { joint, samples: vec![sample], lines: vec![line] });
            }
        }
    }
}

/// Writes the format of [`TorqueData::parse`], without dates.
impl fmt::Display for TorqueData {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for comment in &self.provenance {
            writeln!(f, "# {comment}")?;
        }
        let measured = if self.is_force { Column::Force } else { Column::Torque };
        let columns = [Column::Joint, Column::Direction, Column::PerMille, measured];
        writeln!(f, "{}", columns.map(Column::name).join(","))?;
        for JointReadings { joint, samples, .. } in &self.joints {
            let joint = readings::quoted(joint).ok_or(fmt::Error)?;
            for Sample { torque, per_mille, direction } in samples {
                writeln!(f, "{joint},{direction},{per_mille},{torque:.5}")?;
            }
        }
        Ok(())
    }
}

/// Column of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Joint,
    Direction,
    PerMille,
    Torque,
    Force,
    Date,
}

impl Column {
    const ALL: [Self; 6] =
        [Self::Joint, Self::Direction, Self::PerMille, Self::Torque, Self::Force, Self::Date];

    const fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Direction => "direction",
            Self::PerMille => "per_mille",
            Self::Torque => "torque_nm",
            Self::Force => "force_n",
            Self::Date => "date",
        }
    }
}

/// Line of the table with its joint and date.
struct CurveReading {
    line: usize,
    joint: String,
    date: Option<String>,
    sample: Sample,
}

/// Parses the column names. Returns `None` if some are missing, repeated or unknown.
fn header(readings: &mut Readings<'_>) -> Option<Vec<Column>> {
    let expected = "the columns joint, direction, per_mille, and torque_nm or force_n";
    let known = Column::ALL.map(|column| (column.name(), column));
    let needed = [Column::Joint, Column::Direction, Column::PerMille];
    let (line, columns) = readings.header(&known, &needed, expected)?;
    if columns.contains(&Column::Torque) == columns.contains(&Column::Force) {
        let reason = "must have either a column `torque_nm` or a column `force_n`";
        readings.problem(line, "", reason);
    }
    (!readings.is_refused(line)).then_some(columns)
}

fn parse_row(
    readings: &mut Readings<'_>,
    columns: &[Column],
    readings::DataLine { line, fields }: &readings::DataLine,
) -> Option<CurveReading> {
    let line = *line;
    let (mut joint, mut date) = (None, None);
    let (mut direction, mut per_mille, mut torque) = (None, None, None);
    for (column, field) in columns.iter().zip(fields.iter().map(String::as_str)) {
        let name = column.name();
        match column {
            Column::Joint => joint = readings.joint(line, name, field),
            Column::Direction => direction = readings.direction(line, name, field),
            Column::PerMille => per_mille = readings.per_mille(line, name, field).map(f64::from),
            Column::Torque | Column::Force => torque = readings.number(line, name, field),
            Column::Date => date = (!field.is_empty()).then(|| field.to_owned()),
        }
    }
    let sample = Sample { torque: torque?, per_mille: per_mille?, direction: direction? };
    Some(CurveReading { line, joint: joint?, date, sample })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fit::Direction;
    use crate::torque_data::readings::MAX_PROBLEMS;

    fn parse(text: &str) -> Result<TorqueData, String> {
        TorqueData::parse(Path::new("a.csv"), text).map_err(|invalid| invalid.to_string())
    }

    #[test]
    fn file_of_a_spreadsheet_is_read() {
        let text = "\u{feff}# load cell 20 N\r\n\r\ndate,joint,per_mille,direction,force_n\r\n\
            2026-03-02,grip,-120,-1,-0.5\r\n, 7 ,130,up,+0.75\r\n2026-03-02,grip,1,+1,1e-2\r\n";
        let data = parse(text).unwrap();
        assert_eq!(data.provenance, ["load cell 20 N"]);
        assert_eq!(data.dates, ["2026-03-02"]);
        assert!(data.is_force);
        let joints: Vec<&str> = data.joints.iter().map(|joint| joint.joint.as_str()).collect();
        assert_eq!(joints, ["grip", "7"]);
        assert_eq!(
            data.joints[0].samples[0],
            Sample { torque: -0.5, per_mille: -120.0, direction: Direction::Down }
        );
        assert_eq!(data.joints[0].samples.len(), 2);
        assert_eq!((&data.joints[0].lines[..], &data.joints[1].lines[..]), (&[4, 6][..], &[5][..]));
    }

    #[test]
    fn every_problem_is_reported_with_line_and_column() {
        let text = "joint,direction,per_mille,torque_nm\n,up,1,1\na,left,1.5,inf\na,up,1\n";
        assert_eq!(
            parse(text).unwrap_err(),
            "a.csv:2: joint: must not be empty\n\
             a.csv:3: direction: must be up, +1, down or -1, got `left`\n\
             a.csv:3: per_mille: must be an integer within -32768..=32767, got `1.5`\n\
             a.csv:3: torque_nm: must be a finite number, got `inf`\n\
             a.csv:4: must have 4 fields, got 3"
        );
    }

    #[test]
    fn header_names_each_required_column_once() {
        let error = parse("# x\njoint;direction;per_mille;torque_nm\na;up;1;1\n").unwrap_err();
        assert!(error.starts_with("a.csv:2: expected the columns joint, "), "{error}");
        assert_eq!(error.lines().count(), 1, "one mistake, one line");
        let error = parse("joint,way,per_mille,torque_nm\n").unwrap_err();
        assert!(error.contains("a.csv:1: way: unknown column"), "{error}");
        assert!(error.contains("a.csv:1: direction: this column is missing"), "{error}");
        let both = parse("joint,direction,per_mille,torque_nm,force_n\n").unwrap_err();
        assert!(both.contains("either"), "{both}");
        let twice = parse("joint,joint,direction,per_mille,torque_nm\n").unwrap_err();
        assert_eq!(twice, "a.csv:1: joint: must appear once, got it twice");
    }

    #[test]
    fn quoted_fields_are_read_and_written() {
        let text = "\"joint\",direction,per_mille,torque_nm\n\"left, \"\"arm\"\"\",\"up\",1,\"0.5\"\n\"#2\",up,1,1\n";
        let data = parse(text).unwrap();
        let joints: Vec<&str> = data.joints.iter().map(|joint| joint.joint.as_str()).collect();
        assert_eq!(joints, ["left, \"arm\"", "#2"]);
        assert_eq!(parse(&data.to_string()).unwrap(), data);
        let open = parse("joint,direction,per_mille,torque_nm\n\"left,up,1,1\n").unwrap_err();
        assert_eq!(open, "a.csv:2: a quote is not closed on its line");
    }

    #[test]
    fn empty_or_invalid_file_is_reported_in_few_lines() {
        assert_eq!(parse("").unwrap_err(), "a.csv: must have at least one reading");
        let text = format!("joint,direction,per_mille,torque_nm\n{}", "a,up,1,x\n".repeat(999));
        assert_eq!(parse(&text).unwrap_err().lines().count(), MAX_PROBLEMS + 1);
        assert!(parse("joint,direction,per_mille,torque_nm\na\u{7},up,1,1\n").is_err());
    }

    proptest! {
        #[test]
        fn written_readings_are_read_back(
            readings in prop::collection::vec((0..3_u8, any::<i16>(), -9.0..9.0_f64, any::<bool>()), 1..50)
        ) {
            let mut data = TorqueData { provenance: vec!["from, a # test".into()], ..TorqueData::default() };
            for (line, (joint, per_mille, torque, is_up)) in (3..).zip(readings) {
                let direction = if is_up { Direction::Up } else { Direction::Down };
                let torque = (torque * 1e5).round() / 1e5;
                let sample = Sample { torque, per_mille: per_mille.into(), direction };
                data.add(Some(CurveReading { line, joint: format!("j{joint}"), date: None, sample }));
            }
            let mut read = parse(&data.to_string()).unwrap();
            // Readings are written by joint, so their lines change.
            for (read, written) in read.joints.iter_mut().zip(&data.joints) {
                read.lines.clone_from(&written.lines);
            }
            prop_assert_eq!(read, data);
        }

        #[test]
        fn any_text_gives_readings_or_a_reason(text in "(joint,direction,per_mille,torque_nm\n)?[a-z0-9,.#\n\r-]{0,80}") {
            if let Ok(data) = parse(&text) {
                prop_assert!(!data.joints.is_empty());
            }
        }
    }
}
