//! Recorded slow sweeps of joints, and held postures: input of the fit of friction.
//!
//! ```text
//! # 6077h, mean of each plateau, 2026-03-02                     comments: provenance of the data
//! joint,velocity_rad_per_s,per_mille,direction,q1,q2,q3,q4,q5,q6
//! elbow,0.2,131,,0,-0.87,1.2,-0.79,0,0
//! elbow,0,118,up,0,-0.87,1.2,-0.79,0,0                          held, approached from below
//! ```
//!
//! | column               | content                                                                 |
//! |----------------------|-------------------------------------------------------------------------|
//! | `joint`              | name or number of the joint that moves                                  |
//! | `velocity_rad_per_s` | its velocity; `velocity_m_per_s` for prismatic joints; 0 if held        |
//! | `per_mille`          | actual torque (6077h) in ‰ of rated torque, an integer                  |
//! | `direction`          | direction of the motion, `up` or `down`; required if held               |
//! | `q1` … `q6`          | positions of all joints, in rad or m; all or none                       |
//! | `time_s`             | optional, any number                                                    |

use std::fmt;
use std::path::{Path, PathBuf};

use crate::fit::Direction;
use crate::torque_data::readings::{self, Readings};
use config::Invalid;
use config::files::Files;
use config::problem;
use config::trust::Trust;

/// Sweeps of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SweepData {
    /// Name of the file.
    pub file: PathBuf,
    /// Comment lines, without `#`.
    pub provenance: Vec<String>,
    /// Velocities are those of prismatic joints, in m/s instead of rad/s.
    pub is_linear: bool,
    /// Joints, in order of appearance.
    pub joints: Vec<JointSweep>,
}

/// Torques of a joint at constant velocities, for its friction.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSweep {
    /// Name or number of the joint, as written.
    pub joint: String,
    /// Readings, at least one.
    pub readings: Vec<SweepReading>,
}

/// Torque of a joint at a constant velocity, or at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepReading {
    /// Line of the reading, from 1; 0 without a file.
    pub line: usize,
    /// Velocity of the joint in rad/s or m/s; zero if held.
    pub velocity: f64,
    /// Direction of the motion, or of the motion before the joint was held.
    pub direction: Direction,
    /// Actual torque (6077h), in ‰ of rated torque.
    pub per_mille: i16,
    /// Positions of all joints in rad or m, if recorded.
    pub q: Option<[f64; 6]>,
}

impl SweepReading {
    /// Returns whether the joint is at rest.
    pub fn is_held(&self) -> bool {
        self.velocity.abs() <= 0.0
    }
}

impl SweepData {
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
        let mut data = Self { file: file.to_path_buf(), ..Self::default() };
        if let Some(columns) = header(&mut readings) {
            data.is_linear = columns.contains(&Column::Linear);
            for row in readings.rows(columns.len()) {
                if let Some((joint, reading)) = parse_row(&mut readings, &columns, &row) {
                    data.add(joint, reading);
                }
            }
        }
        data.provenance = std::mem::take(&mut readings.comments);
        let is_empty = data.joints.is_empty();
        readings.finish(data, is_empty)
    }

    fn add(&mut self, joint: String, reading: SweepReading) {
        match self.joints.iter_mut().find(|swept| swept.joint == joint) {
            Some(swept) => swept.readings.push(reading),
            None => self.joints.push(JointSweep { joint, readings: vec![reading] }),
        }
    }
}

/// Writes the format of [`SweepData::parse`], with postures.
impl fmt::Display for SweepData {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for comment in &self.provenance {
            writeln!(f, "# {comment}")?;
        }
        let velocity = if self.is_linear { Column::Linear } else { Column::Angular };
        writeln!(f, "joint,{},per_mille,direction,q1,q2,q3,q4,q5,q6", velocity.name())?;
        for JointSweep { joint, readings } in &self.joints {
            let joint = readings::quoted(joint).ok_or(fmt::Error)?;
            for SweepReading { velocity, direction, per_mille, q, .. } in readings {
                write!(f, "{joint},{velocity},{per_mille},{direction}")?;
                for position in q.unwrap_or_default() {
                    write!(f, ",{}", (position * 1e5).round() / 1e5)?;
                }
                writeln!(f)?;
            }
        }
        Ok(())
    }
}

/// Column of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Joint,
    Angular,
    Linear,
    PerMille,
    Direction,
    Time,
    /// Position of a joint, from 0.
    Position(usize),
}

impl Column {
    const POSITIONS: [(&'static str, Self); 6] = [
        ("q1", Self::Position(0)),
        ("q2", Self::Position(1)),
        ("q3", Self::Position(2)),
        ("q4", Self::Position(3)),
        ("q5", Self::Position(4)),
        ("q6", Self::Position(5)),
    ];
    const OTHERS: [Self; 6] =
        [Self::Joint, Self::Angular, Self::Linear, Self::PerMille, Self::Direction, Self::Time];

    fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Angular => "velocity_rad_per_s",
            Self::Linear => "velocity_m_per_s",
            Self::PerMille => "per_mille",
            Self::Direction => "direction",
            Self::Time => "time_s",
            Self::Position(place) => Self::POSITIONS.get(place).map_or("q", |(name, _)| *name),
        }
    }
}

/// Parses the column names. Returns `None` if some are missing, repeated or unknown.
fn header(readings: &mut Readings<'_>) -> Option<Vec<Column>> {
    let expected = "the columns joint, velocity_rad_per_s or velocity_m_per_s, and per_mille";
    let mut known = Column::OTHERS.map(|column| (column.name(), column)).to_vec();
    known.extend(Column::POSITIONS);
    let needed = [Column::Joint, Column::PerMille];
    let (line, columns) = readings.header(&known, &needed, expected)?;
    if columns.contains(&Column::Angular) == columns.contains(&Column::Linear) {
        let reason =
            "must have either a column `velocity_rad_per_s` or a column `velocity_m_per_s`";
        readings.problem(line, "", reason);
    }
    let positions = columns.iter().filter(|column| matches!(column, Column::Position(_))).count();
    if positions != 0 && positions != Column::POSITIONS.len() {
        readings.problem(
            line,
            "",
            format_args!("must have all of q1 to q6 or none, got {positions}"),
        );
    }
    (!readings.is_refused(line)).then_some(columns)
}

fn parse_row(
    readings: &mut Readings<'_>,
    columns: &[Column],
    readings::DataLine { line, fields }: &readings::DataLine,
) -> Option<(String, SweepReading)> {
    let line = *line;
    let (mut joint, mut velocity, mut per_mille) = (None, None, None);
    let (mut given, mut is_right) = (None, true);
    let mut q = columns.contains(&Column::Position(0)).then_some([0.0; 6]);
    for (column, field) in columns.iter().zip(fields.iter().map(String::as_str)) {
        let name = column.name();
        match column {
            Column::Joint => joint = readings.joint(line, name, field),
            Column::Angular | Column::Linear => velocity = readings.number(line, name, field),
            Column::PerMille => per_mille = readings.per_mille(line, name, field),
            Column::Direction if field.is_empty() => {}
            Column::Direction => {
                given = readings.direction(line, name, field);
                is_right &= given.is_some();
            }
            Column::Time => is_right &= readings.number(line, name, field).is_some(),
            Column::Position(place) => {
                let position = readings.number(line, name, field);
                is_right &= position.is_some();
                if let Some(q) = q.as_mut().and_then(|q| q.get_mut(*place)) {
                    *q = position.unwrap_or_default();
                }
            }
        }
    }
    let velocity = velocity?;
    let direction = is_right.then(|| direction(readings, line, velocity, given, q.is_some()))??;
    Some((joint?, SweepReading { line, velocity, direction, per_mille: per_mille?, q }))
}

/// Returns the direction of a velocity, or that of the field if the joint is held.
fn direction(
    readings: &mut Readings<'_>,
    line: usize,
    velocity: f64,
    given: Option<Direction>,
    has_posture: bool,
) -> Option<Direction> {
    let name = Column::Direction.name();
    let moving = if velocity > 0.0 { Direction::Up } else { Direction::Down };
    if velocity.abs() <= 0.0 {
        if given.is_none() {
            let reason = "must be up or down where the joint is held: the side from which it came";
            readings.problem(line, name, reason);
        }
        if !has_posture {
            let reason = "a held joint needs q1 to q6: its torque is compared with gravity there";
            readings.problem(line, "", reason);
        }
        return given.filter(|_| has_posture);
    }
    if given.is_some_and(|given| given != moving) {
        let reason = format_args!("must be {moving} where the velocity is {velocity}");
        readings.problem(line, name, reason);
    }
    Some(moving)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<SweepData, String> {
        SweepData::parse(Path::new("a.csv"), text).map_err(|invalid| invalid.to_string())
    }

    #[test]
    fn sweep_with_and_without_postures_is_read() {
        let plain =
            "# mean of plateaus\ntime_s,joint,per_mille,velocity_m_per_s\n0.5,3,-120,-0.02\n";
        let data = parse(plain).unwrap();
        assert_eq!(data.provenance, ["mean of plateaus"]);
        assert!(data.is_linear);
        let [reading] = data.joints[0].readings[..] else { panic!() };
        assert_eq!((reading.line, reading.q, reading.direction), (3, None, Direction::Down));
        let held = "joint,velocity_rad_per_s,per_mille,direction,q1,q2,q3,q4,q5,q6\n\
            elbow,0.2,131,,0,1,2,3,4,5\nelbow,0,118,up,0,1,2,3,4,5\n";
        let data = parse(held).unwrap();
        assert!(!data.is_linear && data.joints[0].readings[1].is_held());
        assert_eq!(data.joints[0].readings[0].q, Some([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
        let again = parse(&data.to_string()).unwrap();
        assert_eq!(again.joints, data.joints);
    }

    #[test]
    fn every_problem_is_reported_with_line_and_column() {
        let text = "joint,velocity_rad_per_s,per_mille,direction\na,fast,1,\na,0.1,1.5,\n\
            a,0.1,1,down\na,0,1,up\na,0.1,1,left\n";
        assert_eq!(
            parse(text).unwrap_err(),
            "a.csv:2: velocity_rad_per_s: must be a finite number, got `fast`\n\
             a.csv:3: per_mille: must be an integer within -32768..=32767, got `1.5`\n\
             a.csv:4: direction: must be up where the velocity is 0.1\n\
             a.csv:5: a held joint needs q1 to q6: its torque is compared with gravity there\n\
             a.csv:6: direction: must be up, +1, down or -1, got `left`"
        );
        let error = parse("joint,per_mille,q1,q2\n").unwrap_err();
        assert!(error.contains("either a column `velocity_rad_per_s`"), "{error}");
        assert!(error.contains("all of q1 to q6 or none, got 2"), "{error}");
        let side = "joint,velocity_rad_per_s,per_mille,q1,q2,q3,q4,q5,q6\na,0,1,0,0,0,0,0,0\n";
        assert!(parse(side).unwrap_err().contains("the side from which it came"));
    }
}
