//! Text file of readings, one per line: comments, a line of column names, and rows of comma-separated fields. Its readers
//! interpret the columns.
//!
//! Fields may be quoted as in spreadsheets, `"left, arm"`, with doubled quotes inside, but not over several lines.
//! All problems of a file are found in one run, each with line and column.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::fit::Direction;
use config::{Invalid, Problem};

/// Maximum number of reported problems.
pub(super) const MAX_PROBLEMS: usize = 20;

/// Lines of a file, and its problems.
#[derive(Debug)]
pub(super) struct Readings<'t> {
    file: PathBuf,
    /// Comment lines, without `#`.
    pub(super) comments: Vec<String>,
    /// Other lines, with their numbers from 1.
    lines: std::vec::IntoIter<(usize, &'t str)>,
    problems: Vec<Problem>,
}

/// A line of readings, split into its fields.
#[derive(Debug)]
pub(super) struct DataLine {
    /// Number of the line, from 1.
    pub(super) line: usize,
    pub(super) fields: Vec<String>,
}

impl<'t> Readings<'t> {
    /// Splits `text`, the content of `file`, into lines.
    pub(super) fn new(file: &Path, text: &'t str) -> Self {
        let (mut comments, mut lines, mut broken) = (Vec::new(), Vec::new(), Vec::new());
        for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            if line.contains(|c: char| c.is_control() && c != '\t') {
                broken.push(number);
            } else if let Some(comment) = line.trim_start().strip_prefix('#') {
                comments.push(comment.trim().to_owned());
            } else if !line.trim().is_empty() {
                lines.push((number, line));
            }
        }
        let (file, lines) = (file.to_path_buf(), lines.into_iter());
        let mut readings = Self { file, comments, lines, problems: Vec::new() };
        for line in broken {
            readings.problem(line, "", "a control character");
        }
        readings
    }

    /// Adds a problem of a line.
    pub(super) fn problem(&mut self, line: usize, column: &str, reason: impl fmt::Display) {
        self.problems.push(Problem {
            file: self.file.clone(),
            line: Some(line),
            key: column.to_owned(),
            reason: reason.to_string(),
        });
    }

    /// Takes the line of column names. Returns its number and the columns, or `None` if there are none. Unknown, repeated
    /// or missing names are problems of the line.
    pub(super) fn header<C: Copy + PartialEq>(
        &mut self,
        known: &[(&'static str, C)],
        needed: &[C],
        expected: &str,
    ) -> Option<(usize, Vec<C>)> {
        let (line, text) = self.lines.next()?;
        let names = self.fields(line, text)?;
        let column = |name: &str| known.iter().find(|(known, _)| *known == name);
        if !names.iter().any(|name| column(name).is_some()) {
            self.problem(line, "", format_args!("expected {expected}, with commas between them"));
            return None;
        }
        let mut columns = Vec::new();
        for name in &names {
            match column(name) {
                Some((_, column)) if columns.contains(column) => {
                    self.problem(line, name, "must appear once, got it twice");
                }
                Some((_, column)) => columns.push(*column),
                None => self.problem(line, name, "unknown column; columns are separated by commas"),
            }
        }
        let is_missing = |column: &C| needed.contains(column) && !columns.contains(column);
        for (name, _) in known.iter().filter(|(_, column)| is_missing(column)) {
            self.problem(line, name, "this column is missing");
        }
        Some((line, columns))
    }

    /// Returns whether a line has a problem.
    pub(super) fn is_refused(&self, line: usize) -> bool {
        self.problems.iter().any(|problem| problem.line == Some(line))
    }

    /// Takes the remaining lines as rows of `width` fields; another number of fields is a problem.
    pub(super) fn rows(&mut self, width: usize) -> Vec<DataLine> {
        let mut rows = Vec::new();
        while let Some((line, text)) = self.lines.next() {
            let Some(fields) = self.fields(line, text) else { continue };
            if fields.len() == width {
                rows.push(DataLine { line, fields });
            } else {
                let found = fields.len();
                self.problem(line, "", format_args!("must have {width} fields, got {found}"));
            }
        }
        rows
    }

    /// Returns `value`, or the first problems of the file in the order of its lines.
    ///
    /// # Errors
    /// Returns the problems, or, without problems, that the file has no reading if `is_empty`.
    pub(super) fn finish<T>(mut self, value: T, is_empty: bool) -> Result<T, Invalid> {
        if self.problems.is_empty() && is_empty {
            let (file, reason) = (self.file, "must have at least one reading".to_owned());
            return Err(Invalid(vec![Problem { file, line: None, key: String::new(), reason }]));
        }
        if self.problems.is_empty() {
            return Ok(value);
        }
        self.problems.sort_by_key(|problem| problem.line);
        let next = self.problems.get(MAX_PROBLEMS).and_then(|problem| problem.line);
        self.problems.truncate(MAX_PROBLEMS);
        if let Some(line) = next {
            self.problem(line, "", "more than 20 problems; no more are listed");
        }
        Err(Invalid(self.problems))
    }

    fn fields(&mut self, line: usize, text: &str) -> Option<Vec<String>> {
        let fields = split(text);
        if fields.is_none() {
            self.problem(line, "", "a quote is not closed on its line");
        }
        fields
    }

    /// Parses the name of a joint; an invalid field is a problem.
    pub(super) fn joint(&mut self, line: usize, column: &str, field: &str) -> Option<String> {
        if field.is_empty() {
            self.problem(line, column, "must not be empty");
        }
        (!field.is_empty()).then(|| field.to_owned())
    }

    /// Parses a driving direction; an invalid field is a problem.
    pub(super) fn direction(
        &mut self,
        line: usize,
        column: &str,
        field: &str,
    ) -> Option<Direction> {
        match field {
            "up" | "+1" | "1" => Some(Direction::Up),
            "down" | "-1" => Some(Direction::Down),
            other => {
                let reason = format_args!("must be up, +1, down or -1, got `{other}`");
                self.problem(line, column, reason);
                None
            }
        }
    }

    /// Parses a torque in ‰ of rated torque; an invalid field is a problem.
    pub(super) fn per_mille(&mut self, line: usize, column: &str, field: &str) -> Option<i16> {
        let whole = field.parse::<i16>().ok();
        if whole.is_none() {
            let reason = format_args!("must be an integer within -32768..=32767, got `{field}`");
            self.problem(line, column, reason);
        }
        whole
    }

    /// Parses a finite number; an invalid field is a problem.
    pub(super) fn number(&mut self, line: usize, column: &str, field: &str) -> Option<f64> {
        let number = field.parse::<f64>().ok().filter(|number| number.is_finite());
        if number.is_none() {
            self.problem(line, column, format_args!("must be a finite number, got `{field}`"));
        }
        number
    }
}

/// Returns a field as written: quoted if it contains a comma or a quote, or would begin a comment.
pub(super) fn quoted(field: &str) -> Option<String> {
    let mut writer = csv::WriterBuilder::new().comment(Some(b'#')).from_writer(Vec::new());
    writer.write_record([field]).ok()?;
    let line = String::from_utf8(writer.into_inner().ok()?).ok()?;
    line.strip_suffix('\n').map(str::to_owned)
}

/// Returns the fields of a line without quotes and surrounding blanks, or `None` if a quote is not closed.
fn split(line: &str) -> Option<Vec<String>> {
    let is_closed = line.matches('"').count().is_multiple_of(2);
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.has_headers(false).trim(csv::Trim::All).from_reader(line.as_bytes());
    let record = reader.into_records().next()?.ok().filter(|_| is_closed)?;
    Some(record.iter().map(str::to_owned).collect())
}
