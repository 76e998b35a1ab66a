//! Measured joint torques as a text file, one reading per line: input of the fit of a torque curve (paper, 4.2).
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
//!
//! Fields may be quoted as in spreadsheets, `"left, arm"`, with doubled quotes inside, but not over several lines.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::files;
use crate::problem::{Invalid, Problem};
use crate::trust::Trust;
use controller::fit::{Direction, Sample};

/// Maximum number of reported problems.
const MAX_PROBLEMS: usize = 20;

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
    pub joints: Vec<Measured>,
}

/// Readings of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Name or number, as written.
    pub joint: String,
    /// Readings, at least one.
    pub samples: Vec<Sample>,
}

impl TorqueData {
    /// Reads a file.
    ///
    /// # Errors
    /// The first 20 problems of the file, with line and column.
    pub fn load(file: &Path) -> Result<Self, Invalid> {
        Self::parse(file, &files::text(Trust::Any, file)?)
    }

    /// Parses `text`, the content of `file`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        let mut reader = Reader { file: file.to_path_buf(), line: 0, problems: Vec::new() };
        let mut data = Self::default();
        let mut header: Option<Vec<Column>> = None;
        for line in text.trim_start_matches('\u{feff}').lines() {
            reader.line += 1;
            if reader.problems.len() >= MAX_PROBLEMS {
                reader.problem("", "more than 20 problems; the rest was not read");
                break;
            }
            if line.contains(|c: char| c.is_control() && c != '\t') {
                reader.problem("", "a control character");
            } else if let Some(comment) = line.trim_start().strip_prefix('#') {
                data.provenance.push(comment.trim().to_owned());
            } else if line.trim().is_empty() {
                // Blank lines separate.
            } else if let Some(columns) = &header {
                data.add(reader.row(columns, line));
            } else {
                let Some(columns) = reader.header(line) else { break };
                data.is_force = columns.contains(&Column::Force);
                header = Some(columns);
            }
        }
        reader.line = 0;
        if reader.problems.is_empty() && data.joints.is_empty() {
            reader.problem("", "must have at least one reading");
        }
        if reader.problems.is_empty() { Ok(data) } else { Err(Invalid(reader.problems)) }
    }

    fn add(&mut self, row: Option<Row>) {
        let Some(Row { joint, date, sample }) = row else { return };
        if let Some(date) = date.filter(|date| !self.dates.contains(date)) {
            self.dates.push(date);
        }
        match self.joints.iter_mut().find(|measured| measured.joint == joint) {
            Some(measured) => measured.samples.push(sample),
            None => self.joints.push(Measured { joint, samples: vec![sample] }),
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
        for Measured { joint, samples } in &self.joints {
            let joint = quoted(joint).ok_or(fmt::Error)?;
            for Sample { torque, per_mille, direction } in samples {
                writeln!(f, "{joint},{direction},{per_mille},{torque:.5}")?;
            }
        }
        Ok(())
    }
}

/// Returns a field as written: quoted if it contains a comma or a quote, or would begin a comment.
fn quoted(field: &str) -> Option<String> {
    let mut writer = csv::WriterBuilder::new().comment(Some(b'#')).from_writer(Vec::new());
    writer.write_record([field]).ok()?;
    let line = String::from_utf8(writer.into_inner().ok()?).ok()?;
    line.strip_suffix('\n').map(str::to_owned)
}

/// Returns the fields of a line without quotes and surrounding blanks, or `None` if a quote is not closed.
fn fields(line: &str) -> Option<Vec<String>> {
    let is_closed = line.matches('"').count().is_multiple_of(2);
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.has_headers(false).trim(csv::Trim::All).from_reader(line.as_bytes());
    let record = reader.into_records().next()?.ok().filter(|_| is_closed)?;
    Some(record.iter().map(str::to_owned).collect())
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

/// One reading.
struct Row {
    joint: String,
    date: Option<String>,
    sample: Sample,
}

/// Parser of lines that collects their problems.
struct Reader {
    file: PathBuf,
    /// Current line, from 1; 0 for the file as a whole.
    line: usize,
    problems: Vec<Problem>,
}

impl Reader {
    fn problem(&mut self, column: &str, reason: impl fmt::Display) {
        self.problems.push(Problem {
            file: self.file.clone(),
            line: (self.line > 0).then_some(self.line),
            key: column.to_owned(),
            reason: reason.to_string(),
        });
    }

    /// Parses the column names. Returns `None` if some are missing, repeated or unknown.
    fn header(&mut self, line: &str) -> Option<Vec<Column>> {
        let before = self.problems.len();
        let names = self.fields(line)?;
        let is_known = |name: &String| Column::ALL.iter().any(|column| column.name() == name);
        if !names.iter().any(is_known) {
            let reason = "expected the columns joint, direction, per_mille, and torque_nm or force_n, with \
                commas between them";
            self.problem("", reason);
            return None;
        }
        let mut columns = Vec::new();
        for name in names.iter().map(String::as_str) {
            match Column::ALL.into_iter().find(|column| column.name() == name) {
                Some(column) if columns.contains(&column) => {
                    self.problem(name, "must appear once, got it twice");
                }
                Some(column) => columns.push(column),
                None => self.problem(name, "unknown column; columns are separated by commas"),
            }
        }
        for needed in [Column::Joint, Column::Direction, Column::PerMille] {
            if !columns.contains(&needed) {
                self.problem(needed.name(), "this column is missing");
            }
        }
        if columns.contains(&Column::Torque) == columns.contains(&Column::Force) {
            self.problem("", "must have either a column `torque_nm` or a column `force_n`");
        }
        (self.problems.len() == before).then_some(columns)
    }

    fn fields(&mut self, line: &str) -> Option<Vec<String>> {
        let fields = fields(line);
        if fields.is_none() {
            self.problem("", "a quote is not closed on its line");
        }
        fields
    }

    fn row(&mut self, columns: &[Column], line: &str) -> Option<Row> {
        let fields = self.fields(line)?;
        if fields.len() != columns.len() {
            let (found, wanted) = (fields.len(), columns.len());
            self.problem("", format_args!("must have {wanted} fields, got {found}"));
            return None;
        }
        let (mut joint, mut date) = (None, None);
        let (mut direction, mut per_mille, mut torque) = (None, None, None);
        for (column, field) in columns.iter().zip(fields.iter().map(String::as_str)) {
            match column {
                Column::Joint => joint = self.joint(field),
                Column::Direction => direction = self.direction(field),
                Column::PerMille => per_mille = self.per_mille(field),
                Column::Torque | Column::Force => torque = self.torque(*column, field),
                Column::Date => date = (!field.is_empty()).then(|| field.to_owned()),
            }
        }
        let sample = Sample { torque: torque?, per_mille: per_mille?, direction: direction? };
        Some(Row { joint: joint?, date, sample })
    }

    fn joint(&mut self, field: &str) -> Option<String> {
        if field.is_empty() {
            self.problem(Column::Joint.name(), "must not be empty");
        }
        (!field.is_empty()).then(|| field.to_owned())
    }

    fn direction(&mut self, field: &str) -> Option<Direction> {
        match field {
            "up" | "+1" | "1" => Some(Direction::Up),
            "down" | "-1" => Some(Direction::Down),
            other => {
                let reason = format_args!("must be up, +1, down or -1, got `{other}`");
                self.problem(Column::Direction.name(), reason);
                None
            }
        }
    }

    fn per_mille(&mut self, field: &str) -> Option<f64> {
        let whole = field.parse::<i16>();
        if whole.is_err() {
            let reason = format_args!("must be an integer within -32768..=32767, got `{field}`");
            self.problem(Column::PerMille.name(), reason);
        }
        whole.ok().map(f64::from)
    }

    fn torque(&mut self, column: Column, field: &str) -> Option<f64> {
        let number = field.parse::<f64>().ok().filter(|number| number.is_finite());
        if number.is_none() {
            self.problem(column.name(), format_args!("must be a finite number, got `{field}`"));
        }
        number
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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
            for (joint, per_mille, torque, is_up) in readings {
                let direction = if is_up { Direction::Up } else { Direction::Down };
                let torque = (torque * 1e5).round() / 1e5;
                let sample = Sample { torque, per_mille: per_mille.into(), direction };
                data.add(Some(Row { joint: format!("j{joint}"), date: None, sample }));
            }
            prop_assert_eq!(parse(&data.to_string()), Ok(data));
        }

        #[test]
        fn any_text_gives_readings_or_a_reason(text in "(joint,direction,per_mille,torque_nm\n)?[a-z0-9,.#\n\r-]{0,80}") {
            if let Ok(data) = parse(&text) {
                prop_assert!(!data.joints.is_empty());
            }
        }
    }
}
