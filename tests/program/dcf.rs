//! DCF files of the nodes: against their plans, in order, complete or not at all.

use crate::common::prelude::*;
use crate::eds_check::compare;
use canopen_tools::concise;

#[test]
fn dcf_of_each_node_matches_its_plan() {
    let out = folder("eds", "dcf").join("new");
    let outcome = frhc(&["export", "dcf", "--config", KRAFT, "--out", out.to_str().unwrap()]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    let config = config(KRAFT);
    let names: Vec<_> =
        outcome.stdout.lines().map(|line| line.rsplit('/').next().unwrap()).collect();
    assert_eq!(names.len(), 7);
    assert_eq!(fs::read_dir(&out).unwrap().count(), 7, "no temporary files");
    for (name, (_, plan)) in names.iter().zip(config.node_plans()) {
        let bytes = fs::read(out.join(name)).unwrap();
        let eds = Eds::parse(&bytes).unwrap();
        assert_eq!(eds.lint(), [], "{name}");
        assert_eq!(eds.commissioning().unwrap().node, Some(plan.node));
        let configured = |object| eds.object(object).unwrap().configured(plan.node);
        let mut expected = std::collections::BTreeMap::new();
        for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes()) {
            expected.insert(object, canopen::sdo::bytes(&value));
        }
        for (object, value) in &plan.safety {
            expected.insert(*object, canopen::sdo::bytes(value));
        }
        for (object, value) in
            expected.into_iter().filter(|(object, _)| eds.object(*object).is_some())
        {
            assert_eq!(configured(object), Some(value), "{name}: {object}");
        }
        assert_eq!(
            configured(Object::PRODUCER_HEARTBEAT),
            Some(plan.error_control.period_ms().to_le_bytes().to_vec())
        );
        assert_eq!(configured(Object::DEVICE_TYPE), None);
    }
    let elbow = fs::read(out.join("3_elbow.dcf")).unwrap();
    compare("3_elbow.dcf", std::str::from_utf8(&elbow).unwrap());
}

#[test]
fn concise_dcf_contains_every_download_in_order() {
    let out = folder("eds", "concise");
    let args = ["export", "dcf", "--concise", "--config", KRAFT, "--out", out.to_str().unwrap()];
    assert_eq!(frhc(&args).code, 0);
    let config = config(KRAFT);
    let (_, plan) = &config.node_plans()[2];
    let downloads = concise::decode(&fs::read(out.join("3_elbow.cdcf")).unwrap()).unwrap();
    let mut rest = downloads.iter();
    for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes()) {
        let content = canopen::sdo::bytes(&value);
        let found = rest.find(|download| download.object == object);
        assert_eq!(found.map(|found| &found.content), Some(&content), "{object}");
    }
    assert_eq!(downloads.last().unwrap().object, Object::MODE_OF_OPERATION);
}

#[test]
fn failed_export_writes_no_file() {
    let folder = folder("eds", "whole");
    let out = folder.join("out");
    let args = ["export", "dcf", "--config", KRAFT, "--out", out.to_str().unwrap()];
    let export = |more: &[&str]| frhc(&[&args[..], more].concat());
    fs::write(&out, "a file").unwrap();
    let outcome = export(&[]);
    assert!(outcome.code != 0 && outcome.stderr.contains("out"), "{}", outcome.stderr);
    assert_eq!(fs::read(&out).unwrap(), b"a file");
    fs::remove_file(&out).unwrap();
    // A folder with the name of an output file.
    fs::create_dir_all(out.join("5_yaw.dcf")).unwrap();
    fs::write(out.join("3_elbow.dcf"), "mine").unwrap();
    for force in [&[][..], &["--force"]] {
        let outcome = export(force);
        let named = if force.is_empty() { "3_elbow.dcf exists" } else { "5_yaw.dcf" };
        assert!(outcome.code != 0 && outcome.stderr.contains(named), "{}", outcome.stderr);
        assert_eq!(fs::read_dir(&out).unwrap().count(), 2, "no temporary files");
        assert_eq!(fs::read(out.join("3_elbow.dcf")).unwrap(), b"mine");
    }
}

#[test]
fn dcf_export_is_reproducible() {
    let out = folder("eds", "twice");
    let args = ["export", "dcf", "--force", "--config", JPL, "--out", out.to_str().unwrap()];
    let written = || {
        let outcome = frhc(&args);
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        let files = outcome.stdout.lines().map(|path| fs::read(path).unwrap()).collect::<Vec<_>>();
        assert_eq!(fs::read_dir(&out).unwrap().count(), files.len());
        files
    };
    assert_eq!(written(), written());
}

#[test]
fn dcf_of_real_drives_is_written_and_slips_are_named() {
    for (file, slip) in [
        ("maxon_epos4", ""),
        ("elmo_gold", "1016h:1 must be within 0..=65535"),
        ("technosoft_ipos", ""),
    ] {
        let out = folder("eds", file).join("new");
        let config = format!("config/drives/{file}.toml");
        let outcome = frhc(&["export", "dcf", "--config", &config, "--out", out.to_str().unwrap()]);
        assert_eq!(outcome.code, 0, "{file}: {}", outcome.stderr);
        assert_eq!(outcome.stderr.is_empty(), slip.is_empty(), "{file}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(slip), "{file}: {}", outcome.stderr);
        assert_eq!(fs::read_dir(&out).unwrap().count(), 7, "{file}");
    }
}
