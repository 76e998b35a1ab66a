//! The paper's section 4.2 in simulation: with a straight line for a torque curve, a simple test force
//! feels all wrong; with the polynomial it does not.
#![cfg(test)]
#![allow(clippy::print_stdout, reason = "both errors are what this is for")]

mod common;

use std::path::Path;

use frhc::config::Config;
use frhc::controller::JointVector;
use frhc::lab::bench::Bench;
use frhc::sim::scenario::Scenario;
use frhc::telemetry::record::Mode;

const TEXT: &str = include_str!("../config/kraft_like.toml");
const CONTACT: &str = include_str!("../config/scenarios/contact_10s.toml");

/// How far what the drives exert is from what was asked for, at the grip, in N.
#[derive(Debug, Default)]
struct Error {
    squares: f64,
    worst: f64,
    force: f64,
    count: f64,
}

impl Error {
    fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }

    /// In percent of the mean test force.
    fn percent(&self) -> [f64; 2] {
        let mean = self.force / self.count;
        [self.rms(), self.worst].map(|error| 100.0 * error / mean)
    }
}

/// The configuration whose joints have a straight line each: rated torque and gear, as a manufacturer
/// gives them.
fn straight() -> Config {
    let mut text = String::new();
    let (mut gear, mut rated) = (0.0, 0.0);
    for line in TEXT.lines() {
        let value = |line: &str| -> f64 {
            line.split_once(" = ").unwrap().1.split('#').next().unwrap().trim().parse().unwrap()
        };
        if line.starts_with("gear_ratio") {
            gear = value(line);
        } else if line.starts_with("rated_torque_nm") {
            rated = value(line);
        }
        if line.starts_with("torque_curve") {
            let slope: f64 = 1e3 / (f64::abs(gear) * rated);
            text.push_str(&format!("torque_curve = [{slope}, 0.0, 0.0]\n"));
        } else {
            text.push_str(line);
            text.push('\n');
        }
    }
    Config::parse(Path::new("config/kraft_like.toml"), &text).unwrap()
}

/// Ten seconds of pushing along x; the drives have the true curves, the node believes `believed`.
fn felt(believed: &Config) -> Error {
    let truth = Config::parse(Path::new("config/kraft_like.toml"), TEXT).unwrap();
    let scenario = Scenario::parse(CONTACT).unwrap();
    let mut bench = Bench::believing(believed, &truth, scenario, 1, false, ());
    bench.bring_up().unwrap();
    let mut error = Error::default();
    let mut before = None;
    for _ in 0..9_000 {
        let record = bench.cycle();
        // A target acts from the next SYNC: what acts now was asked for a cycle ago.
        let asked = before.replace(record.output);
        let (Some(asked), Mode::Engaged) = (asked, record.mode) else { continue };
        let force = asked.f_g_task.force.norm();
        if force < 0.5 {
            continue;
        }
        let exerted = JointVector::from(bench.world_mut().drives().each_ref().map(|d| d.torque()));
        let mut transposed = nalgebra::SMatrix::<f64, 6, 6>::zeros();
        transposed.fixed_columns_mut::<3>(0).copy_from(&asked.j_g.linear.transpose());
        transposed.fixed_columns_mut::<3>(3).copy_from(&asked.j_g.angular.transpose());
        let wrong = transposed.try_inverse().unwrap() * (exerted - asked.tau);
        let wrong = wrong.fixed_rows::<3>(0).norm();
        error.squares += wrong * wrong;
        error.worst = error.worst.max(wrong);
        error.force += force;
        error.count += 1.0;
    }
    assert!(error.count > 1_000.0, "{error:?}");
    error
}

#[test]
fn a_straight_line_distorts_a_test_force_and_the_polynomial_does_not() {
    let polynomial = felt(&Config::parse(Path::new("config/kraft_like.toml"), TEXT).unwrap());
    let line = felt(&straight());
    let ([poly_rms, poly_worst], [line_rms, line_worst]) = (polynomial.percent(), line.percent());
    println!(
        "error of the force at the grip, of the test force: straight line {line_rms:.1} % rms, \
         {line_worst:.1} % at most; polynomial {poly_rms:.1} % rms, {poly_worst:.1} % at most"
    );
    assert!(poly_rms < 2.0, "{polynomial:?}");
    assert!(line_rms > 5.0 * poly_rms && line_rms > 5.0, "{line:?}");
}
