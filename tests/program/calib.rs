//! `frhc sim --calibrate`, `frhc calib fit` and `frhc calib check`, as a user runs them.

use crate::common::prelude::*;

/// Writes measurements in both directions of a joint with this torque curve; returns the path.
fn readings(name: &str, curve: impl Fn(f64) -> f64) -> String {
    let mut text = "joint,direction,per_mille,torque_nm\n".to_owned();
    for direction in ["up", "down"] {
        for step in -20..=20 {
            let torque = f64::from(step) / 5.0;
            text += &format!("elbow,{direction},{:.0},{torque}\n", curve(torque));
        }
    }
    let path = folder("calib", name).join("elbow.csv");
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn unknown_curve_is_fitted_and_its_fragment_is_a_valid_config() {
    let folder = folder("calib", "round_trip");
    let (csv, out) = (folder.join("pitch.csv"), folder.join("out"));
    let (csv, out) = (csv.to_str().unwrap(), out.to_str().unwrap());
    let args =
        ["sim", "--config", KRAFT, "--calibrate", "4", "--seed", "11", "--out", csv, "--reveal"];
    let measured = frhc(&args);
    assert_eq!((measured.code, measured.stdout.as_str()), (0, ""), "{}", measured.stderr);
    let secret: toml::Table = measured.stderr.parse().unwrap();
    let secret = secret["torque_curve"].as_array().unwrap();

    let fit = frhc(&["calib", "fit", csv, "--config", KRAFT, "--out", out, "--json"]);
    assert_eq!(fit.code, 0, "{}", fit.stderr);
    let report: Value = serde_json::from_str(&fit.stdout).unwrap();
    let stated = report["joints"][0]["both"]["left_out_rms_per_mille"].as_f64().unwrap();

    let text = fs::read_to_string(Path::new(out).join("torque_curves.toml")).unwrap();
    let fragment: toml::Table = text.parse().unwrap();
    let joint = &fragment["joint"][0];
    assert_eq!(joint["name"].as_str(), Some("pitch"));
    let curve = joint["torque_curve"].as_array().unwrap();
    let at = |c: &[toml::Value], t: f64| -> f64 {
        c.iter().zip([t, t.powi(3), t.powi(5)]).map(|(c, t)| c.as_float().unwrap() * t).sum()
    };
    for t in [0.1, 0.4, 0.8, 1.2] {
        let error = (at(curve, t) - at(secret, t)).abs();
        assert!(error < stated && error < 0.01 * at(secret, 1.2), "{error} ‰ at {t} N·m");
    }
    let config = fs::read_to_string(KRAFT).unwrap();
    let old = config.lines().filter(|line| line.starts_with("torque_curve")).nth(3).unwrap();
    let new = text.lines().find(|line| line.starts_with("torque_curve")).unwrap();
    let config = parse(KRAFT, &config.replacen(old, new, 1));
    assert_eq!(config.joints[3].plant.actuator.torque_curve[0], curve[0].as_float().unwrap());
    assert!(fs::read_to_string(Path::new(out).join("pitch.svg")).unwrap().ends_with("</svg>\n"));
}

#[test]
fn measurements_hide_the_curve_and_repeat_with_the_seed() {
    let measure =
        |args: &[&str]| frhc(&[&["sim", "--config", KRAFT, "--calibrate"], args].concat());
    let measured = measure(&["elbow", "--seed", "5"]);
    assert_eq!((measured.code, measured.stderr.as_str()), (0, ""));
    assert!(measured.stdout.contains("# simulated drive of joint elbow, seed 5"));
    assert!(!measured.stdout.contains("curve"));
    assert_eq!(measure(&["3", "--seed", "5"]).stdout, measured.stdout);
    assert_ne!(measure(&["3", "--seed", "6"]).stdout, measured.stdout);
    assert_eq!(measure(&["knee"]).code, 2);
    assert_eq!(measure(&["elbow", "-i", "vcan0"]).code, 2);
}

#[test]
fn curve_that_is_not_monotone_is_rejected_with_its_torque() {
    // Slope 100 (1 - 3 u + 2 u²) with u = t² / 16: zero at √8 N·m.
    let csv = readings("flat", |t| 1000.0 * (t - t.powi(3) / 16.0 + 0.4 * t.powi(5) / 256.0));
    let out = folder("calib", "flat_out");
    let fit = frhc(&["calib", "fit", &csv, "--out", out.to_str().unwrap()]);
    assert_eq!(fit.code, 1);
    assert!(fit.stderr.contains("joint elbow: the curve stops rising at 2.82"), "{}", fit.stderr);
    let fragment = fs::read_to_string(out.join("torque_curves.toml")).unwrap();
    assert!(fragment.contains("# elbow: rejected") && !fragment.contains("[[joint]]\nname"));
    assert!(!out.join("elbow.svg").exists());
    let again = frhc(&["calib", "fit", &csv, "--out", out.to_str().unwrap()]);
    assert_eq!(again.code, 2, "{}", again.stderr);
    assert!(again.stderr.contains("torque_curves.toml exists"), "{}", again.stderr);
    assert_eq!(frhc(&["calib", "fit", &csv, "--force", "--out", out.to_str().unwrap()]).code, 1);
}

#[test]
fn reversed_motor_is_rejected() {
    let csv = readings("turned", |t| -200.0 * t);
    assert_eq!(frhc(&["calib", "fit", &csv]).code, 0);
    let fit = frhc(&["calib", "fit", &csv, "--config", KRAFT]);
    assert_eq!(fit.code, 1);
    assert!(fit.stderr.contains("turns against the joint, but gear_ratio is 36"), "{}", fit.stderr);
}

#[test]
fn invalid_csv_is_refused_with_every_line_and_column() {
    let path = folder("calib", "wrong").join("wrong.csv");
    let csv = path.to_str().unwrap();
    fs::write(&path, "joint,direction,per_mille,torque_nm\na,up,1,x\na,over,1,1\n").unwrap();
    let fit = frhc(&["calib", "fit", csv]);
    assert_eq!(fit.code, 3);
    assert!(fit.stderr.contains("wrong.csv:2: torque_nm: must be a finite number, got `x`"));
    assert!(fit.stderr.contains("wrong.csv:3: direction: must be up, +1, down or -1, got `over`"));
    assert_eq!(frhc(&["calib", "fit", "none.csv"]).code, 3);
    let good = readings("good", |t| 200.0 * t);
    assert_eq!(frhc(&["calib", "fit", &good, "--joint", "yaw"]).code, 2);
    assert_eq!(frhc(&["calib", "fit", &good, "--joint", "knee", "--config", KRAFT]).code, 2);
    assert_eq!(frhc(&["calib", "fit", &good, "--joint", "3", "--config", KRAFT]).code, 0);
}

#[test]
fn curves_of_a_configuration_are_checked() {
    let check = frhc(&["calib", "check", "--config", KRAFT, "--json"]);
    assert_eq!(check.code, 0, "{}", check.stderr);
    let report: Value = serde_json::from_str(&check.stdout).unwrap();
    assert_eq!(report["joints"].as_array().unwrap().len(), 6);
    assert!(report["joints"][0]["least_slope_per_mille"].as_f64().unwrap() > 100.0);
    let text = fs::read_to_string(KRAFT)
        .unwrap()
        .replace("../eds/", concat!(env!("CARGO_MANIFEST_DIR"), "/eds/"));
    let path = folder("calib", "config").join("flat.toml");
    fs::write(&path, text.replace("-0.393453", "-9.393453")).unwrap();
    let check = frhc(&["calib", "check", "--config", path.to_str().unwrap()]);
    assert_eq!(check.code, 3);
    assert!(
        check.stderr.contains("joint[0].torque_curve: the curve stops rising"),
        "{}",
        check.stderr
    );
}
