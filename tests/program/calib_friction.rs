//! `frhc sim --calibrate-friction` and `frhc calib friction`, as a user runs them.

use crate::common::prelude::*;

/// Simulates a sweep of a joint; returns its path, and its true Coulomb and viscous friction.
fn sweep(test: &str, config: &str, joint: &str, seed: &str) -> (PathBuf, [f64; 2]) {
    let path = folder("calib_friction", test).join("sweep.csv");
    let out = path.to_str().unwrap();
    let args = ["sim", "--config", config, "--calibrate-friction", joint, "--seed", seed];
    let ended = frhc(&[&args[..], &["--out", out, "--reveal"]].concat());
    assert_eq!((ended.code, ended.stdout.as_str()), (0, ""), "{}", ended.stderr);
    let truth: toml::Table = ended.stderr.parse().unwrap();
    (path, ["coulomb", "viscous"].map(|key| truth[key].as_float().unwrap()))
}

fn fit(path: &Path, config: &str, more: &[&str]) -> CommandOutput {
    let args = ["calib", "friction", path.to_str().unwrap(), "--config", config];
    frhc(&[&args[..], more].concat())
}

/// Writes the sweep with each line after the column names changed, or dropped.
fn change(path: &Path, mut change: impl FnMut(usize, Vec<String>) -> Option<Vec<String>>) {
    let text = fs::read_to_string(path).unwrap();
    let lines = (1..).zip(text.lines()).filter_map(|(number, line)| {
        if line.starts_with('#') || line.starts_with("joint,") {
            return Some(line.to_owned());
        }
        let fields = line.split(',').map(str::to_owned).collect();
        change(number, fields).map(|fields| fields.join(","))
    });
    let changed = lines.collect::<Vec<_>>().join("\n") + "\n";
    fs::write(path, changed).unwrap();
}

/// Fits the changed sweep of a joint; returns the output of the command.
fn refused(
    test: &str,
    joint: &str,
    code: i32,
    each: impl FnMut(usize, Vec<String>) -> Option<Vec<String>>,
) -> String {
    let (path, _) = sweep(test, KRAFT, joint, "1");
    change(&path, each);
    let ended = fit(&path, KRAFT, &[]);
    assert_eq!(ended.code, code, "{test}: {}{}", ended.stdout, ended.stderr);
    ended.stderr
}

fn number(field: &str) -> f64 {
    field.parse().unwrap()
}

#[test]
fn friction_of_any_joint_is_found_and_its_fragment_is_valid() {
    for (config, joint, seed) in
        [(KRAFT, "elbow", "1"), (KRAFT, "2", "5"), (JPL, "slide", "2"), (JPL, "grip roll", "3")]
    {
        let (path, truth) = sweep("found", config, joint, seed);
        let out = path.parent().unwrap().join("out");
        let ended = fit(&path, config, &["--json", "--out", out.to_str().unwrap()]);
        assert_eq!(ended.code, 0, "{joint}: {}", ended.stderr);
        let report: Value = serde_json::from_str(&ended.stdout).unwrap();
        let found = &report["joints"][0];
        for (key, truth) in ["coulomb", "viscous"].into_iter().zip(truth) {
            for direction in ["up", "down", "both"] {
                let [value, deviation] = ["value", "deviation"]
                    .map(|part| found[direction][key][part].as_f64().unwrap());
                let off = (value - truth).abs();
                assert!(off < 4.0 * deviation && off < 0.25 * truth, "{joint} {direction} {key}");
            }
        }
        assert_eq!(found["gravity"]["postures"], 8);
        assert!(found["gravity"]["largest_share_of_capacity"].as_f64().unwrap() < 0.002);

        let fragment = fs::read_to_string(out.join("friction.toml")).unwrap();
        let parsed: toml::Table = fragment.parse().unwrap();
        let name = parsed["joint"][0]["name"].as_str().unwrap();
        let text = fs::read_to_string(config).unwrap();
        let (before, entry) = text.split_once(&format!("name = \"{name}\"")).unwrap();
        let replaced = entry.lines().map(|line| {
            let key = line.split(" = ").next().unwrap();
            let new = fragment.lines().find(|new| new.starts_with(key) && key.contains("friction"));
            new.unwrap_or(line).to_owned() + "\n"
        });
        let replaced = format!("{before}name = \"{name}\"{}", replaced.collect::<String>());
        let entered = parse(config, &replaced);
        let coulomb = entered.joint(name).unwrap().plant.friction.coulomb;
        assert!((coulomb / truth[0] - 1.0).abs() < 0.06, "{coulomb} {truth:?}");
    }
}

#[test]
fn sweeps_of_several_files_are_joined_by_joint() {
    let (elbow, _) = sweep("joined", KRAFT, "elbow", "1");
    let other = elbow.with_file_name("more.csv");
    let args = ["sim", "--config", KRAFT, "--calibrate-friction", "azimuth", "--out"];
    assert_eq!(frhc(&[&args[..], &[other.to_str().unwrap()]].concat()).code, 0);
    let more = other.to_str().unwrap();
    let both = fit(&elbow, KRAFT, &[more]);
    assert_eq!(both.code, 0, "{}", both.stderr);
    let lines = both.stdout.lines().filter(|line| line.contains("readings in motion"));
    let lines: Vec<&str> = lines.collect();
    assert_eq!(lines.len(), 2, "{}", both.stdout);
    assert!(lines[0].starts_with("azimuth: more.csv"), "{lines:?}");
    assert!(lines[1].starts_with("elbow: sweep.csv"), "{lines:?}");
    let one = fit(&elbow, KRAFT, &[more, "--joint", "3"]);
    assert!(!one.stdout.contains("azimuth") && one.stdout.contains("elbow"), "{}", one.stdout);
    assert_eq!(fit(&elbow, KRAFT, &["--joint", "yaw"]).code, 2);
    assert_eq!(fit(&elbow, KRAFT, &["--joint", "knee"]).code, 2);
}

#[test]
fn readings_without_positions_need_a_constant_load() {
    let without = |test: &str, joint: &str| {
        let (path, truth) = sweep(test, KRAFT, joint, "1");
        let text = fs::read_to_string(&path).unwrap();
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        let moving = lines.filter(|line| line.split(',').nth(1) != Some("0"));
        let cut = moving.map(|line| line.split(',').take(3).collect::<Vec<_>>().join(",") + "\n");
        fs::write(&path, cut.collect::<String>()).unwrap();
        (fit(&path, KRAFT, &["--json"]), truth)
    };
    let (azimuth, [coulomb, _]) = without("no_posture_azimuth", "azimuth");
    assert_eq!(azimuth.code, 0, "{}", azimuth.stderr);
    let report: Value = serde_json::from_str(&azimuth.stdout).unwrap();
    let found = report["joints"][0]["both"]["coulomb"]["value"].as_f64().unwrap();
    assert!((found / coulomb - 1.0).abs() < 0.06, "{found} {coulomb}");
    assert!(azimuth.stdout.contains("without q1 to q6 gravity is not subtracted"));
    // The weight of the elbow changes with its angle by much more than its friction.
    let (elbow, _) = without("no_posture_elbow", "elbow");
    assert_eq!(elbow.code, 1, "{}", elbow.stdout);
    assert!(elbow.stderr.contains("Coulomb friction is known to ±"), "{}", elbow.stderr);
}

#[test]
fn wrong_mass_is_seen_in_held_postures() {
    let (path, _) = sweep("mass", KRAFT, "elevation", "1");
    let text = fs::read_to_string(KRAFT)
        .unwrap()
        .replace("../eds/", concat!(env!("CARGO_MANIFEST_DIR"), "/eds/"))
        .replace("mass_kg = 0.75", "mass_kg = 1.15");
    let heavier = path.with_file_name("heavier.toml");
    fs::write(&heavier, text).unwrap();
    let ended = fit(&path, heavier.to_str().unwrap(), &[]);
    // What gravity misses along the sweep is several times the friction.
    assert_eq!(ended.code, 1, "{}", ended.stdout);
    assert!(ended.stderr.contains("mend gravity if it is off"), "{}", ended.stderr);
    let warning = ":154: the held torque is +0.43";
    assert!(ended.stdout.contains(warning), "{}", ended.stdout);
    assert!(
        ended.stdout.contains("off the configured gravity, 7.2 % of the capacity; check masses"),
        "{}",
        ended.stdout
    );
}

#[test]
fn readings_that_contradict_friction_are_rejected() {
    let turned = refused("turned", "azimuth", 1, |_, mut fields| {
        fields[1] = (-number(&fields[1])).to_string();
        fields[3] = if fields[3] == "up" { "down" } else { "up" }.to_owned();
        Some(fields)
    });
    assert!(turned.contains("the torque is larger downwards than upwards"), "{turned}");
    assert!(turned.contains("held postures need more torque from above"), "{turned}");

    let falling = refused("falling", "azimuth", 1, |_, mut fields| {
        fields[2] = (number(&fields[2]) - 8.0 * number(&fields[1])).round().to_string();
        Some(fields)
    });
    assert!(falling.contains("friction up falls with speed, by 0.0"), "{falling}");

    let one_way =
        refused("one_way", "azimuth", 1, |_, fields| (fields[3] == "up").then_some(fields));
    assert!(one_way.contains("no reading moves down; friction needs both"), "{one_way}");

    let mut fastest = 0.0_f64;
    let one_speed = refused("one_speed", "azimuth", 1, |_, fields| {
        let speed = number(&fields[1]).abs();
        fastest = if fastest > 0.0 { fastest } else { speed };
        ((speed - fastest).abs() < 1e-9 || speed == 0.0).then_some(fields)
    });
    assert!(one_speed.contains("have 1 different speeds, and at least 3"), "{one_speed}");

    let spikes = refused("spikes", "azimuth", 1, |line, mut fields| {
        if [10, 40, 70, 100].contains(&line) {
            fields[2] = "400".to_owned();
        }
        Some(fields)
    });
    assert!(spikes.contains("4 of 144 readings are outliers"), "{spikes}");
}

#[test]
fn outlier_is_listed_by_line_and_left_out() {
    let (path, truth) = sweep("spike", KRAFT, "azimuth", "1");
    change(&path, |line, mut fields| {
        if line == 40 {
            fields[2] = "400".to_owned();
        }
        Some(fields)
    });
    let ended = fit(&path, KRAFT, &[]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(ended.stdout.contains("left out     1 of 144: sweep.csv:40 (+"), "{}", ended.stdout);
    let json = fit(&path, KRAFT, &["--json"]).stdout;
    let report: Value = serde_json::from_str(&json).unwrap();
    let found = report["joints"][0]["both"]["coulomb"]["value"].as_f64().unwrap();
    assert!((found / truth[0] - 1.0).abs() < 0.05, "{found} {truth:?}");
}

#[test]
fn wrong_readings_are_refused_by_line_all_in_one_run() {
    let stderr = refused("lines", "elbow", 3, |line, mut fields| {
        match line {
            6 => fields[2] = "20000".to_owned(),
            7 => fields[5] = "-50".to_owned(),
            _ => {}
        }
        Some(fields)
    });
    assert!(stderr.contains("sweep.csv:6: per_mille: must be within the calibrated range of ±"));
    assert!(
        stderr.contains(
            "sweep.csv:7: q2: must be within -1.7453..=0.6981 rad of elevation, got -50; degrees?"
        ),
        "{stderr}"
    );
    let stderr = refused("columns", "elbow", 3, |line, mut fields| {
        match line {
            6 => fields[1] = "fast".to_owned(),
            7 => fields[3] = "down".to_owned(),
            8 => fields.truncate(3),
            _ => {}
        }
        Some(fields)
    });
    assert!(
        stderr.contains("sweep.csv:6: velocity_rad_per_s: must be a finite number"),
        "{stderr}"
    );
    assert!(
        stderr.contains("sweep.csv:7: direction: must be up where the velocity is"),
        "{stderr}"
    );
    assert!(stderr.contains("sweep.csv:8: must have 10 fields, got 3"), "{stderr}");
    let stderr = refused("joint", "elbow", 3, |_, mut fields| {
        fields[0] = "knee".to_owned();
        Some(fields)
    });
    assert!(stderr.contains("no joint knee"), "{stderr}");
    let (path, _) = sweep("slide", JPL, "slide", "1");
    let ended = fit(&path, KRAFT, &[]);
    assert_eq!(ended.code, 3);
    assert!(ended.stderr.contains("no joint slide"), "{}", ended.stderr);
    let text = fs::read_to_string(&path).unwrap().replace("m_per_s", "rad_per_s");
    fs::write(&path, text).unwrap();
    let ended = fit(&path, JPL, &[]);
    assert!(ended.stderr.contains("slide is prismatic; its velocities must be in a column"));
    assert_eq!((ended.code, fit(Path::new("none.csv"), KRAFT, &[]).code), (3, 3));
}

#[test]
fn coupled_joint_has_no_sweep_of_its_own() {
    let (path, _) = sweep("coupled", KRAFT, "elbow", "1");
    let rows: Vec<String> = (0..6)
        .map(|row| {
            let entry = |column: usize| match (row, column) {
                (2, 1) => "-1.0",
                _ if row == column => "1.0",
                _ => "0.0",
            };
            format!("[{}]", (0..6).map(entry).collect::<Vec<_>>().join(", "))
        })
        .collect();
    let text = fs::read_to_string(KRAFT)
        .unwrap()
        .replace("../eds/", concat!(env!("CARGO_MANIFEST_DIR"), "/eds/"));
    let coupled = path.with_file_name("coupled.toml");
    fs::write(&coupled, format!("{text}\n[coupling]\nmatrix = [{}]\n", rows.join(", "))).unwrap();
    let config = coupled.to_str().unwrap();
    let ended = fit(&path, config, &[]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    assert!(ended.stderr.contains("elbow is coupled with others"), "{}", ended.stderr);
    let sim = frhc(&["sim", "--config", config, "--calibrate-friction", "elevation"]);
    assert_eq!(sim.code, 2, "{}", sim.stderr);
}

#[test]
fn sweeps_hide_the_friction_and_repeat_with_the_seed() {
    let simulate = |seed: &str| {
        frhc(&["sim", "--config", KRAFT, "--calibrate-friction", "elbow", "--seed", seed])
    };
    let first = simulate("5");
    assert_eq!((first.code, first.stderr.as_str()), (0, ""));
    assert!(!first.stdout.contains("coulomb"));
    assert_eq!(simulate("5").stdout, first.stdout);
    assert_ne!(simulate("6").stdout, first.stdout);
    let both = ["sim", "--config", KRAFT, "--calibrate", "elbow", "--calibrate-friction", "elbow"];
    assert_eq!(frhc(&both).code, 2);
    assert_eq!(frhc(&["sim", "--config", KRAFT, "--reveal"]).code, 2);
}

#[test]
fn static_friction_at_slow_speeds_is_seen_as_falling() {
    let path = folder("calib_friction", "stiction").join("sweep.csv");
    let text = fs::read_to_string(KRAFT)
        .unwrap()
        .replace("../eds/", concat!(env!("CARGO_MANIFEST_DIR"), "/eds/"));
    let (before, joint) = text.split_once("rest_deg = 0.0").unwrap();
    let stiff = format!("{before}simulated = {{ stiction_nm = 0.2 }}\nrest_deg = 0.0{joint}");
    let config = path.with_file_name("stiff.toml");
    fs::write(&config, stiff).unwrap();
    let config = config.to_str().unwrap();
    let out = path.to_str().unwrap();
    let sim = frhc(&["sim", "--config", config, "--calibrate-friction", "azimuth", "--out", out]);
    assert_eq!(sim.code, 0, "{}", sim.stderr);
    // The slowest speed is 0.098 rad/s: exp(-(0.098 / 0.05)²) of the excess is 0.004 N·m, and at rest all of it is there.
    let ended = fit(&path, KRAFT, &[]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let at_rest = ended.stdout.split("friction at rest ").nth(1).unwrap();
    let at_rest: f64 = at_rest.split(' ').next().unwrap().parse().unwrap();
    assert!(at_rest > 0.22, "{at_rest}");
    // Ten times slower, friction falls along the sweep.
    change(&path, |_, mut fields| {
        let v = number(&fields[1]) / 10.0;
        let excess = if v == 0.0 { 0.0 } else { 0.2 * (-(v / 0.05_f64).powi(2)).exp() };
        fields[1] = v.to_string();
        fields[2] = (number(&fields[2]) + 133.0 * excess * v.signum()).round().to_string();
        Some(fields)
    });
    let ended = fit(&path, KRAFT, &[]);
    assert_eq!(ended.code, 1, "{}", ended.stdout);
    assert!(ended.stderr.contains("falls with speed"), "{}", ended.stderr);
}
