//! `frhc calib fit` on good and bad measurements: a row for each, with its verdict, its words, and the error that is
//! left in the curve. Without these checks all but the last group passed without a word.

use crate::common::prelude::*;

/// Azimuth and elbow of the configuration, and their ends in N·m.
const AZIMUTH: Curve = Curve { c: [133.144, -0.393_453, 0.019_672_6], end: 6.0 };
const ELBOW: Curve = Curve { c: [199.779, -1.328_32, 0.149_436], end: 4.0 };
/// Targets in each direction.
const STEPS: i32 = 80;

/// A true torque curve.
#[derive(Clone, Copy)]
struct Curve {
    c: [f64; 3],
    end: f64,
}

impl Curve {
    fn at(&self, t: f64) -> f64 {
        self.c[0] * t + self.c[1] * t.powi(3) + self.c[2] * t.powi(5)
    }

    /// The torque of a target, also somewhat beyond the end.
    fn torque(&self, per_mille: f64) -> f64 {
        let (mut low, mut high) = (-2.0 * self.end, 2.0 * self.end);
        for _ in 0..80 {
            let middle = f64::midpoint(low, high);
            if self.at(middle) < per_mille { low = middle } else { high = middle }
        }
        low
    }
}

/// Line of the table that a bench would write.
#[derive(Clone, Copy)]
struct Reading {
    is_up: bool,
    per_mille: f64,
    torque: f64,
}

/// Measurements of a joint.
#[derive(Clone)]
struct Data {
    joint: &'static str,
    truth: Curve,
    readings: Vec<Reading>,
}

/// SplitMix64, and a sum of twelve uniform numbers for a normal one.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        f64::from(u32::try_from((z ^ z >> 31) >> 32).unwrap()) / f64::from(u32::MAX)
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

impl Data {
    /// Targets from end to end and back, with this dry friction and noise of the load cell, in N·m.
    fn new(joint: &'static str, truth: Curve, friction: f64, noise: f64) -> Self {
        let (mut readings, mut random) = (Vec::new(), Random(11));
        for is_up in [true, false] {
            for step in 0..=STEPS {
                let part = f64::from(2 * step - STEPS) / f64::from(STEPS);
                let per_mille = (part * truth.at(truth.end)).round();
                let lag = if is_up { friction } else { -friction };
                let torque = truth.torque(per_mille) - lag + noise * random.normal();
                readings.push(Reading { is_up, per_mille, torque });
            }
        }
        Self { joint, truth, readings }
    }

    fn azimuth(friction: f64, noise: f64) -> Self {
        Self::new("azimuth", AZIMUTH, friction, noise)
    }

    fn map(mut self, change: impl Fn(&mut Reading)) -> Self {
        self.readings.iter_mut().for_each(change);
        self
    }

    fn keep(mut self, is_kept: impl Fn(&Reading) -> bool) -> Self {
        self.readings.retain(is_kept);
        self
    }

    /// Moves `count` readings far apart by ±`torque`.
    fn with_outliers(mut self, count: usize, torque: f64) -> Self {
        let every = self.readings.len() / count;
        for place in 0..count {
            let sign = if place % 2 == 0 { 1.0 } else { -1.0 };
            self.readings[place * every + 5].torque += sign * torque;
        }
        self
    }

    fn csv(&self) -> String {
        let mut text = "joint,direction,per_mille,torque_nm\n".to_owned();
        for Reading { is_up, per_mille, torque } in &self.readings {
            let direction = if *is_up { "up" } else { "down" };
            text += &format!("{},{direction},{per_mille:.0},{torque:.5}\n", self.joint);
        }
        text
    }
}

/// Table of readings, and what fitting it must give.
struct Row {
    name: &'static str,
    csv: String,
    truth: Curve,
    has_config: bool,
    code: i32,
    /// Limit of the difference of obtained and commanded torque, in % of the range; infinite if the test does not limit it.
    error: f64,
    words: &'static str,
    /// Dry friction to be found within 1 %, in N·m.
    friction: Option<f64>,
}

impl Row {
    fn new(name: &'static str, csv: String, code: i32, words: &'static str) -> Self {
        let (truth, error) = (AZIMUTH, f64::INFINITY);
        Self { name, csv, truth, has_config: false, code, error, words, friction: None }
    }

    fn accepted(name: &'static str, data: &Data, error: f64, words: &'static str) -> Self {
        Self { truth: data.truth, error, ..Self::new(name, data.csv(), 0, words) }
    }

    fn refused(name: &'static str, data: &Data, error: f64, words: &'static str) -> Self {
        Self { code: 1, ..Self::accepted(name, data, error, words) }
    }

    fn invalid(name: &'static str, csv: impl Into<String>, words: &'static str) -> Self {
        Self::new(name, csv.into(), 3, words)
    }

    /// Measurements with this friction, in N·m, and no noise.
    fn dry(name: &'static str, friction: f64) -> Self {
        let row = Self::accepted(name, &Data::azimuth(friction, 0.0), 0.01, "\"accepted\":true");
        Self { friction: Some(friction), ..row }
    }

    fn with_config(self) -> Self {
        Self { has_config: true, ..self }
    }
}

/// Fits the rows of a table, and compares verdict, error and words.
fn hold(rows: &[Row]) {
    let mut failed = Vec::new();
    for (number, row) in rows.iter().enumerate() {
        let path = folder("calib_table", &format!("{}-{number}", rows[0].name)).join("data.csv");
        fs::write(&path, &row.csv).unwrap();
        let mut args = vec!["calib", "fit", path.to_str().unwrap(), "--json"];
        if row.has_config {
            args.extend(["--config", KRAFT]);
        }
        let fit = frhc(&args);
        let report = serde_json::from_str(&fit.stdout).unwrap_or(Value::Null);
        let error = left(&report["joints"][0], &row.truth);
        println!(
            "{:40} exit {} error {error:7.3} %  {}",
            row.name,
            fit.code,
            fit.stderr.trim_end()
        );
        let friction = &report["joints"][0]["friction"]["torque"];
        let is_found = |friction: f64, found: f64| (found / friction - 1.0).abs() < 0.01;
        let is_right = (row.error.is_infinite() || error <= row.error)
            && row.friction.is_none_or(|wanted| is_found(wanted, friction.as_f64().unwrap()));
        let said = format!("{}{}", fit.stdout, fit.stderr);
        if fit.code != row.code || !is_right || !said.contains(row.words) {
            failed.push(format!("{}: exit {}, {error} %: {said}", row.name, fit.code));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n\n"));
}

/// Returns the largest difference of obtained and commanded torque, in % of the range; NaN without a curve.
fn left(joint: &Value, truth: &Curve) -> f64 {
    let Some(c) = joint["torque_curve"].as_array() else { return f64::NAN };
    let c: Vec<f64> = c.iter().map(|c| c.as_f64().unwrap()).collect();
    let end = joint["max_torque"].as_f64().unwrap();
    let fitted = Curve { c: [c[0], c[1], c[2]], end };
    let error = |step: i32| {
        let asked = end * f64::from(step) / 50.0;
        100.0 * (truth.torque(fitted.at(asked)) - asked).abs() / end
    };
    (-50..=50).map(error).fold(0.0, f64::max)
}

#[test]
fn exact_curves_are_found_in_any_layout() {
    let cubic = Curve { c: [120.0, 0.8, 0.0], end: 6.0 };
    let line = Curve { c: [140.0, 0.0, 0.0], end: 6.0 };
    let exact = |truth| Data::new("azimuth", truth, 0.0, 0.0);
    let reordered = Data::azimuth(0.0, 0.0).readings.iter().fold(
        "\u{feff}torque_nm,joint,per_mille,direction\r\n".to_owned(),
        |text, Reading { is_up, per_mille, torque }| {
            text + &format!(
                "{torque:.5},azimuth,{per_mille},{}\r\n",
                if *is_up { "+1" } else { "-1" }
            )
        },
    );
    let spreadsheet = Row {
        csv: reordered,
        ..Row::accepted("BOM, CRLF, other order", &Data::azimuth(0.0, 0.0), 0.01, "")
    };
    hold(&[
        Row::accepted("exact quintic A", &exact(AZIMUTH), 0.01, ""),
        Row::accepted("exact quintic B", &Data::new("elbow", ELBOW, 0.0, 0.0), 0.01, ""),
        Row::accepted("exact cubic", &exact(cubic), 0.01, ""),
        Row::accepted("exact line", &exact(line), 0.01, ""),
        spreadsheet,
    ]);
}

#[test]
fn friction_leaves_no_error_in_the_curve() {
    hold(&[
        Row::dry("friction 0.05 N·m", 0.05),
        Row::dry("friction 0.2 N·m", 0.2),
        Row::dry("friction 0.6 N·m", 0.6),
        Row::dry("friction 1.5 N·m", 1.5),
    ]);
}

#[test]
fn noise_is_accepted_as_long_as_the_curve_is_known() {
    let noisy = |noise| Data::azimuth(0.1, noise);
    hold(&[
        Row::accepted("noise 0.01 N·m", &noisy(0.01), 0.1, ""),
        Row::accepted("noise 0.05 N·m", &noisy(0.05), 0.5, ""),
        Row::refused("noise 0.2 N·m", &noisy(0.2), 2.0, "misses readings left out by"),
        Row::refused("noise 0.6 N·m", &noisy(0.6), 8.0, "misses readings left out by"),
    ]);
}

#[test]
fn outliers_are_listed_by_line_and_left_out() {
    let wrong = |count, torque| Data::azimuth(0.1, 0.01).with_outliers(count, torque);
    hold(&[
        Row::accepted("1 outlier of 3 N·m", &wrong(1, 3.0), 0.1, "\"line\":7"),
        Row::refused("4 outliers of 3 N·m", &wrong(4, 3.0), 0.1, "4 of 162 readings are outliers"),
        Row::refused("4 outliers, lines", &wrong(4, 3.0), 0.1, "lines 7, 47, 87, 127"),
        Row::refused("8 outliers of 6 N·m", &wrong(8, 6.0), 0.1, "8 of 162 readings are outliers"),
    ]);
}

#[test]
fn uneven_sides_are_distinguished_from_an_offset() {
    let friction = || Data::azimuth(0.1, 0.01);
    let biased = |offset: f64| friction().map(|reading| reading.torque += offset);
    let weaker = |side: f64, part: f64| {
        friction().map(|reading| {
            if reading.torque * side > 0.0 {
                reading.torque *= part;
            }
        })
    };
    let any = f64::INFINITY;
    hold(&[
        Row::refused(
            "load cell +0.5 N·m",
            &biased(0.5),
            any,
            "the load cell has an offset of +0.50",
        ),
        Row::refused(
            "load cell -0.2 N·m",
            &biased(-0.2),
            any,
            "the load cell has an offset of -0.20",
        ),
        Row::accepted("load cell +0.02 N·m", &biased(0.02), 0.5, ""),
        Row::refused("one side 30 % stronger", &weaker(1.0, 1.3), any, "the negative side exerts"),
        Row::refused("one side 30 % weaker", &weaker(1.0, 0.7), any, "the positive side exerts"),
    ]);
}

#[test]
fn scale_is_compared_with_the_configured_curve() {
    let any = f64::INFINITY;
    let milli = Data::new("elbow", ELBOW, 0.0, 0.0).map(|reading| reading.torque *= 1e3);
    let tenfold = Data::azimuth(0.1, 0.01).map(|reading| reading.per_mille *= 10.0);
    let short = Data::azimuth(0.0, 0.0).keep(|reading| reading.torque > -0.4);
    let shorter = Data::azimuth(0.0, 0.0).keep(|reading| reading.torque > -5.0);
    let below = "is below the configured 6 N·m";
    hold(&[
        Row::refused("mN·m as N·m", &milli, any, "are the readings in N·m?").with_config(),
        Row::refused("per mille x10", &tenfold, any, "are the readings in N·m?").with_config(),
        Row::refused("-5 % to 100 % of the range", &short, any, "N·m?").with_config(),
        Row::accepted("-80 % to 100 %", &shorter, 0.05, below).with_config(),
        Row::accepted("mN·m without a configuration", &milli, any, ""),
    ]);
}

#[test]
fn exchanged_directions_are_seen_by_their_sign() {
    let swapped = |friction| Data::azimuth(friction, 0.01).map(|reading| reading.is_up ^= true);
    let any = f64::INFINITY;
    hold(&[
        Row::refused("directions exchanged", &swapped(0.1), any, "exchange up and down"),
        Row::accepted("without friction", &swapped(0.0), 0.1, ""),
    ]);
}

#[test]
fn readings_that_determine_no_curve_are_refused() {
    let data = || Data::azimuth(0.0, 0.0);
    let flat = Curve { c: [100.0, -100.0 / 16.0, 40.0 / 256.0], end: 4.0 };
    let flat = data().map(|reading| {
        reading.torque = reading.per_mille / 867.0 * 4.0;
        reading.per_mille = (10.0 * flat.at(reading.torque)).round();
    });
    let few = |torques: &[f64]| {
        let torques: Vec<f64> =
            torques.iter().map(|t| AZIMUTH.torque(AZIMUTH.at(*t).round())).collect();
        data().keep(|reading| torques.iter().any(|t| (t - reading.torque).abs() < 0.08))
    };
    let any = f64::INFINITY;
    let repeated = Data {
        readings: [-3.0, -1.0, 1.0, 3.0]
            .into_iter()
            .flat_map(|torque| [true, false].map(|is_up| (torque, is_up)))
            .flat_map(|(torque, is_up)| {
                [Reading { is_up, per_mille: AZIMUTH.at(torque).round(), torque }; 4]
            })
            .collect(),
        ..data()
    };
    let reversed = data().map(|reading| reading.per_mille *= -1.0);
    hold(&[
        Row::refused("not monotone", &flat, any, "the curve stops rising at 2.8"),
        Row::refused("one side", &data().keep(|r| r.torque > 0.2), any, "one side of zero torque"),
        Row::refused("3 points", &few(&[-3.0, 0.0, 3.0]), any, "at least 8 are needed"),
        Row::refused("4 torques", &repeated, any, "too few different torques"),
        Row::refused("one direction", &data().keep(|r| r.is_up), any, "no sample was driven down"),
        Row::refused("sign reversed", &reversed, any, "turns against the joint").with_config(),
    ]);
}

#[test]
fn files_that_are_no_readings_are_refused_by_line() {
    let head = "joint,direction,per_mille,torque_nm\n";
    let line = |reading: &str| format!("{head}{reading}\n");
    hold(&[
        Row::invalid("wrong column", "joint,way,per_mille,torque_nm\n", "data.csv:1: way: unknown"),
        Row::invalid("torque_mnm", "joint,direction,per_mille,torque_mnm\n", "torque_mnm: unknown"),
        Row::invalid("NaN", line("a,up,1,NaN"), "data.csv:2: torque_nm: must be a finite number"),
        Row::invalid("garbage", "\u{1}\u{2}\n", "a control character"),
        Row::invalid("empty", "", "must have at least one reading"),
        Row::invalid("semicolons", "joint;direction;per_mille;torque_nm\n", "commas between them"),
        Row::invalid(
            "every line",
            line("a,up,x,1\na,off,1,1"),
            "data.csv:3: direction: must be up",
        ),
    ]);
}
