//! `frhc sim --calibrate` and `frhc calib`, run as a user runs them.
#![cfg(test)]

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::process::Output;

use serde_json::Value;

fn frhc(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_frhc"))
        .args(args)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap()
}

/// A file of this test alone.
fn file(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("calib");
    fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

fn fit(data: &str, more: &[&str]) -> Output {
    frhc(&[&["calib", "fit", data], more].concat())
}

/// The three numbers of a line like `... 178.3440 t -1.08351 t³ +0.243819 t⁵`.
fn revealed(line: &str) -> [f64; 3] {
    let numbers = line.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
    numbers.collect::<Vec<_>>().try_into().unwrap()
}

#[test]
fn an_unknown_curve_is_recovered_from_noisy_data() {
    for (config, joint, max) in [
        ("config/kraft_like.toml", "elbow", 4.0),
        ("config/kraft_like.toml", "elevation", 6.0),
        ("config/jpl_like.toml", "slide", 12.0),
    ] {
        let measured =
            frhc(&["sim", "--config", config, "--calibrate", joint, "--seed", "5", "--reveal"]);
        let data = file(&format!("{joint}.csv"));
        fs::write(&data, &measured.stdout).unwrap();
        let [c1, c3, c5] = revealed(&String::from_utf8(measured.stderr).unwrap());

        let output = fit(data.to_str().unwrap(), &["--json", "--config", config]);
        let fits: Value = serde_json::from_slice(&output.stdout).unwrap();
        let fit = &fits["joints"][0];
        let found: [f64; 3] = serde_json::from_value(fit["both"]["coefficients"].clone()).unwrap();
        let curve = |[c1, c3, c5]: [f64; 3], t: f64| t * (c1 + t * t * (c3 + t * t * c5));
        let full = curve([c1, c3, c5], max);
        for part in 1..=20 {
            let t = max * f64::from(part) / 20.0;
            let off = (curve(found, t) - curve([c1, c3, c5], t)).abs() / full;
            assert!(off < 0.015, "{joint}: {:.2} % off at {t}", 100.0 * off);
        }
        assert!(fit["least_slope"].as_f64().unwrap() > 0.0);
        let [residual, missed, straight] =
            ["residual_per_mille", "leave_one_out_per_mille", "linear_residual_per_mille"]
                .map(|key| fit["both"][key].as_f64().unwrap());
        assert!(residual < missed && missed < straight, "{fits}");
        let sign = if joint == "elevation" { -1.0 } else { 1.0 };
        assert!((fit["sign"].as_f64().unwrap() - sign).abs() < 1e-9);
    }
}

#[test]
fn the_fragment_is_configuration_and_the_picture_a_picture() {
    let data = file("yaw.csv");
    let data = data.to_str().unwrap();
    let config = "config/kraft_like.toml";
    let made = frhc(&["sim", "--config", config, "--calibrate", "yaw", "--out", data]);
    assert!(made.status.success() && made.stdout.is_empty());
    let folder = file("out");
    let output = fit(data, &["--config", config, "--out", folder.to_str().unwrap()]);
    assert!(output.status.success());
    let toml = fs::read_to_string(folder.join("torque_curves.toml")).unwrap();
    assert!(toml.contains("yaw.csv") && toml.contains("seed 1"), "{toml}");
    let text = fs::read_to_string(config).unwrap();
    let joint = text.find("name = \"yaw\"").unwrap();
    let key = |text: &str, key: &str| {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap();
        line.to_owned()
    };
    let mut joint_text = text[joint..].to_owned();
    for name in ["max_torque_nm", "torque_curve"] {
        joint_text = joint_text.replacen(&key(&text[joint..], name), &key(&toml, name), 1);
    }
    let calibrated = format!("{}{joint_text}", &text[..joint]);
    let config = frhc::config::Config::parse(std::path::Path::new(config), &calibrated);
    assert!(config.is_ok(), "{}", config.unwrap_err());
    let svg = fs::read_to_string(folder.join("yaw.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    assert_eq!(svg.matches("<circle").count(), 41 + 1, "rising samples, and one in the legend");
}

#[test]
fn a_curve_that_does_not_rise_is_rejected_and_leaves_nothing() {
    let rows = (-20..=20).map(|step| {
        let t = f64::from(step) / 20.0 * 6.0;
        format!("bent,{},{t}", 100.0 * t - 2.0 * t * t * t)
    });
    let text = format!("joint,per_mille,torque_nm\n{}\n", rows.collect::<Vec<_>>().join("\n"));
    let data = file("bent.csv");
    fs::write(&data, text).unwrap();
    let folder = file("nothing");
    let output = fit(data.to_str().unwrap(), &["--out", folder.to_str().unwrap()]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("joint bent: the curve stops rising at 4.082 N·m"), "{said}");
    assert!(!folder.exists() && output.stdout.is_empty());
}

#[test]
fn a_file_that_is_none_is_refused_by_line_and_column() {
    for (name, text, expected) in [
        ("empty.csv", "", "column torque_nm is missing"),
        ("none.csv", "joint,per_mille,torque_nm\n", "no samples"),
        ("column.csv", "joint,per_mille,torque_nm,colour\n", "column \"colour\": there is joint"),
        ("number.csv", "per_mille,torque_nm\n1,2\n3,four\n", "number.csv:3: torque_nm: \"four\""),
        ("nan.csv", "per_mille,torque_nm\n1,nan\n", "nan.csv:2: torque_nm: \"nan\""),
        ("short.csv", "per_mille,torque_nm\n1,2\n3\n", "short.csv:3: "),
        ("sweep.csv", "per_mille,torque_nm,sweep\n1,2,left\n", "sweep.csv:2: sweep: \"left\""),
    ] {
        let data = file(name);
        fs::write(&data, text).unwrap();
        let output = fit(data.to_str().unwrap(), &[]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{name}: {said}");
        assert!(said.contains(expected), "{name}: {said}");
        assert_eq!(said.lines().count(), 1, "{name}: {said}");
    }
    let output = fit("no/such.csv", &[]);
    assert_eq!(output.status.code(), Some(3));
}

#[test]
fn files_as_spreadsheets_write_them_are_read() {
    let rows =
        (-20..=20).map(|step| format!("\"elbow\", {} , {}\r\n", step * 40, f64::from(step) / 5.0));
    let text = format!(
        "\u{FEFF}# 2026-11-20, load cell 4711\r\njoint, per_mille, torque_nm\r\n\r\n{}",
        rows.collect::<String>()
    );
    let data = file("sheet.csv");
    fs::write(&data, text).unwrap();
    let output = fit(data.to_str().unwrap(), &[]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("joint elbow") && said.contains("not measured"), "{said}");
}

#[test]
fn the_shipped_curves_are_checked() {
    let output = frhc(&["calib", "check", "--config", "config/jpl_like.toml"]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success());
    assert_eq!(said.lines().filter(|line| line.contains("rises everywhere")).count(), 6);
}
