//! `frhc report` as a program: contents of the page, missing parts, and refusals.

use std::os::unix::fs::{PermissionsExt, symlink};

use crate::common::prelude::*;

/// Records a session of `demo` with these arguments.
fn session(name: &str, args: &[&str]) -> PathBuf {
    let session = folder("report", name).join("session");
    let out = ["-q", "demo", "--out", session.to_str().unwrap()];
    let ended = frhc(&[&out[..], args].concat());
    assert!([0, 6].contains(&ended.code), "{args:?}: {}", ended.stderr);
    session
}

fn contact(name: &str) -> PathBuf {
    session(name, &["--scenario", "contact_10s", "--seconds", "8"])
}

fn unplugged(name: &str) -> PathBuf {
    session(name, &["--scenario", "faults/unplug", "--seconds", "4"])
}

fn report(session: &Path, args: &[&str]) -> CommandOutput {
    frhc(&[&["report", session.to_str().unwrap()], args].concat())
}

/// Returns the report of a session, which must be written.
fn page(session: &Path, args: &[&str]) -> String {
    let ended = report(session, &[args, &["--force"]].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let text = fs::read_to_string(ended.stdout.trim_end()).unwrap();
    // All elements are closed, and the page refers to no other file.
    for tag in [
        "section", "table", "figure", "svg", "dl", "ol", "p", "h2", "h3", "div", "text", "tr",
        "td", "th",
    ] {
        let opened =
            text.matches(&format!("<{tag}>")).count() + text.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, text.matches(&format!("</{tag}>")).count(), "{tag}");
    }
    for part in ["<script", "http:", "https:", "url(", "@import", "src=", "NaN", "inf "] {
        let text = text
            .replace("http://www.w3.org/2000/svg", "")
            .replace("http://www.w3.org/1999/xhtml", "");
        assert!(!text.contains(part), "{part}");
    }
    text
}

/// Returns the content of a section.
fn section<'t>(page: &'t str, id: &str) -> &'t str {
    let (_, rest) = page
        .split_once(&format!("<section id=\"{id}\""))
        .unwrap_or_else(|| panic!("no section {id}"));
    rest.split_once("</section>").unwrap().0
}

/// Returns the value of a name in a list of names and values.
fn value<'t>(section: &'t str, name: &str) -> &'t str {
    let (_, rest) =
        section.split_once(&format!("<dt>{name}</dt><dd>")).unwrap_or_else(|| panic!("no {name}"));
    rest.split_once("</dd>").unwrap().0
}

#[test]
fn joint_cause_time_and_way_out_of_a_stop_come_first() {
    let page = page(&unplugged("stopped"), &[]);
    let verdict = section(&page, "verdict");
    assert!(verdict.contains(">joint 3 (elbow): no sample for 3 cycles<"), "{verdict}");
    assert_eq!(value(verdict, "Joint"), "elbow");
    assert_eq!(value(verdict, "Time"), "1.720 s");
    assert_eq!(value(verdict, "Mode before"), "engaged");
    for step in [
        "<code>frhc ctl reset</code>",
        "boots the network",
        "press the emergency stop",
        "release the deadman",
    ] {
        assert!(verdict.contains(step), "{step}: {verdict}");
    }
    // Before anything else that the page has.
    assert!(page.find("id=\"verdict\"").unwrap() < page.find("<svg").unwrap());
    let stops = section(&page, "stops");
    assert!(
        stops.contains("001-1099-samples-missing") && stops.contains("href=\"#stop-1\""),
        "{stops}"
    );
    assert!(stops.contains("id=\"stop-1\"") && stops.contains("position of elbow"), "{stops}");
    assert!(section(&page, "modes").contains("1 elbow"), "the stop is a line in the timeline");
}

#[test]
fn whole_session_has_every_section_and_picture() {
    let page = page(&contact("whole"), &[]);
    assert!(section(&page, "verdict").contains("Nothing stopped it"));
    for (id, text) in [
        ("modes", "engaged"),
        ("summary", "Greatest force felt"),
        ("positions", "elbow in rad"),
        ("torques", ">gravity<"),
        ("wrenches", "force felt in N"),
        ("commands", "displacement in mm"),
        ("energy", "energy in mJ"),
        ("link", "age of the newest sample"),
        ("timing", "p99.9"),
        ("load", "vcan0"),
        ("boot", "ready"),
        ("parts", "every frame as recorded"),
    ] {
        let section = section(&page, id);
        assert!(section.contains(text), "{id}: {text}");
        assert!(!section.contains("class=\"missing\""), "{id}: {section}");
    }
    let pictures = page.matches("<svg").count();
    assert!(pictures >= 20, "{pictures}");
    assert_eq!(page.matches("role=\"img\" aria-label=\"").count(), pictures);
    assert_eq!(page.matches("<figcaption>").count(), page.matches("<figure>").count());
    assert!(page.matches("<caption>").count() >= 5);
    assert!(page.len() < 5 << 20, "{}", page.len());
}

#[test]
fn figures_are_those_of_the_summary() {
    let session = contact("figures");
    let page = page(&session, &[]);
    let summary = fs::read_to_string(session.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let shown = section(&page, "summary");
    let number = |name: &str| -> f64 {
        let text = value(shown, name).split(' ').next().unwrap();
        text.replace('\u{202f}', "").parse().unwrap()
    };
    for (name, key) in [
        ("Greatest force felt", "peak_felt_force_n"),
        ("Engaged", "engaged_seconds"),
        ("Cycles", "cycles"),
        ("Missing samples", "missing_samples"),
    ] {
        let expected = summary[key].as_f64().unwrap();
        assert!((number(name) - expected).abs() <= 0.006 * expected.abs(), "{name}: {expected}");
    }
}

#[test]
fn joint_named_as_an_element_is_escaped_everywhere() {
    let folder = folder("report", "escaped");
    let config = fs::read_to_string(KRAFT).unwrap();
    let eds = concat!("\"", env!("CARGO_MANIFEST_DIR"), "/eds/");
    let config =
        config.replace("\"elbow\"", "\"<script>alert(1)</script>&\"").replace("\"../eds/", eds);
    fs::write(folder.join("a&b<c>.toml"), config).unwrap();
    let config = folder.join("a&b<c>.toml");
    let args =
        ["--config", config.to_str().unwrap(), "--scenario", "faults/unplug", "--seconds", "3"];
    let page = page(&session("escaped-session", &args), &[]);
    assert!(page.contains("&lt;script&gt;alert(1)&lt;/script&gt;&amp;"), "the name is there");
    assert!(page.contains("a&amp;b&lt;c&gt;.toml"), "the path is there");
}

#[test]
fn fault_record_is_reported_with_and_without_its_session() {
    let session = unplugged("record");
    let record = session.join("faults/001-1099-samples-missing");
    let inside = page(&record, &[]);
    assert!(inside.contains("<h1>Fault record 001-1099-samples-missing</h1>"));
    assert!(section(&inside, "verdict").contains("joint 3 (elbow): no sample for 3 cycles"));
    let trip = section(&inside, "trip");
    assert!(
        trip.contains("TPDO1_elevation") && trip.contains("<caption>Frames around the trip"),
        "{trip}"
    );
    assert!(
        section(&inside, "positions").contains("elbow in rad"),
        "with the session's configuration"
    );

    let alone = folder("report", "record-alone").join("record");
    fs::create_dir(&alone).unwrap();
    for file in ["fault.json", "bus.log"] {
        fs::copy(record.join(file), alone.join(file)).unwrap();
    }
    let bare = page(&alone, &[]);
    assert!(section(&bare, "verdict").contains("joint 3 (elbow)"));
    assert!(section(&bare, "positions").contains("give --config FILE"));
    assert!(
        section(&bare, "modes").contains("zero-torque")
            && section(&bare, "wrenches").contains("force sensed")
    );
    let with = page(&alone, &["--config", KRAFT]);
    assert!(section(&with, "positions").contains("elbow in rad"));
    fs::remove_file(alone.join("bus.log")).unwrap();
    let without_log = page(&alone, &[]);
    assert!(section(&without_log, "verdict").contains("joint 3 (elbow)"));
    assert!(section(&without_log, "parts").contains("bus.log"));
}

#[test]
fn sessions_are_compared_by_figure_curve_and_file() {
    let (one, other) = (contact("compared-a"), unplugged("compared-b"));
    let page = page(&one, &["--compare", other.to_str().unwrap()]);
    let comparison = section(&page, "comparison");
    assert!(comparison.contains("config/scenarios/faults/unplug.toml"), "{comparison}");
    assert!(comparison.contains("Both begin at their first engagement"), "{comparison}");
    assert!(comparison.contains("joint 3 (elbow): no sample for 3 cycles"), "{comparison}");
    assert!(comparison.matches("<svg").count() >= 6, "{comparison}");
    let same = contact("compared-c");
    let ended = report(&one, &["--compare", same.to_str().unwrap(), "--force"]);
    let page = fs::read_to_string(ended.stdout.trim_end()).unwrap();
    let comparison = section(&page, "comparison");
    assert!(
        comparison.contains("and all files are the same") && !comparison.contains(">differs<"),
        "{comparison}"
    );
}

#[test]
fn what_is_missing_is_said_and_the_rest_is_done() {
    type Spoil = fn(&Path);
    let spoils: [(&str, Spoil, &str, &str); 7] = [
        ("inputs", |at| fs::remove_file(at.join("inputs.bin")).unwrap(), "wrenches", "inputs.bin"),
        ("log", |at| fs::remove_file(at.join("bus.log")).unwrap(), "parts", "bus.log"),
        (
            "summary",
            |at| fs::remove_file(at.join("summary.json")).unwrap(),
            "summary",
            "no summary.json",
        ),
        (
            "description",
            |at| fs::remove_file(at.join("session.json")).unwrap(),
            "parts",
            "session.json",
        ),
        (
            "version",
            |at| {
                let file = at.join("session.json");
                let text = fs::read_to_string(&file).unwrap();
                let mut description: Value = serde_json::from_str(&text).unwrap();
                description["format"] = 99.into();
                fs::write(file, description.to_string()).unwrap();
            },
            "parts",
            "format 99",
        ),
        (
            "copy",
            |at| {
                let file = at.join("files/01-kraft_like.toml");
                fs::write(&file, fs::read_to_string(&file).unwrap() + "\n").unwrap();
            },
            "parts",
            "not the file that was recorded",
        ),
        (
            "link",
            |at| {
                fs::rename(at.join("inputs.bin"), at.join("moved.bin")).unwrap();
                symlink("moved.bin", at.join("inputs.bin")).unwrap();
            },
            "parts",
            "must be a regular file",
        ),
    ];
    let whole = contact("spoilt");
    for (name, spoil, id, said) in spoils {
        let spoilt = copy(&whole, name);
        spoil(&spoilt);
        let page = page(&spoilt, &[]);
        let text = section(&page, id);
        assert!(text.contains("class=\"missing\"") && text.contains(said), "{name}: {text}");
        // Modes and wrenches need neither description nor replay.
        assert!(section(&page, "modes").contains(">engaged<"), "{name}");
        assert!(section(&page, "wrenches").contains("force sensed in N"), "{name}");
    }
}

#[test]
fn session_that_ends_anywhere_is_reported_up_to_there() {
    let whole = contact("cut");
    for (file, parts) in [("inputs.bin", 7), ("bus.log", 5), ("session.json", 4)] {
        let content = fs::read(whole.join(file)).unwrap();
        for part in 0..parts {
            let cut = copy(&whole, &format!("cut-{file}-{part}"));
            fs::write(cut.join(file), &content[..content.len() * part / parts]).unwrap();
            let page = page(&cut, &[]);
            assert!(
                section(&page, "parts").contains("class=\"missing\"")
                    || file == "bus.log"
                    || page.contains("ends early"),
                "{file} {part}"
            );
        }
    }
}

#[test]
fn folder_that_is_no_session_is_one_line_and_exit_4() {
    let empty = folder("report", "empty");
    for folder in [empty.as_path(), Path::new("no/such/folder"), Path::new("Cargo.toml")] {
        let ended = report(folder, &[]);
        assert_eq!((ended.code, ended.stdout.as_str()), (4, ""), "{}", ended.stderr);
        assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
    }
    assert_eq!(fs::read_dir(&empty).unwrap().count(), 0, "nothing is left");
}

#[test]
fn report_is_for_its_owner_and_never_over_another_file() {
    let session = unplugged("owner");
    let ended = report(&session, &[]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let file = session.join("report.html");
    assert_eq!(ended.stdout.trim_end(), file.to_str().unwrap());
    assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
    fs::write(&file, "mine").unwrap();
    let ended = report(&session, &[]);
    assert_eq!(ended.code, 2, "{}", ended.stderr);
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
    let other = session.join("other.html");
    assert_eq!(report(&session, &["-o", other.to_str().unwrap()]).code, 0);
    let same = fs::read(&other).unwrap();
    assert_eq!(report(&session, &["--force"]).code, 0);
    assert_eq!(fs::read(&file).unwrap(), same, "a report repeats");
}

/// Copies a session.
fn copy(of: &Path, name: &str) -> PathBuf {
    let copy = folder("report", name).join("session");
    for folder in ["", "files"] {
        fs::create_dir(copy.join(folder)).unwrap();
        for entry in fs::read_dir(of.join(folder)).unwrap() {
            let from = entry.unwrap().path();
            if from.is_file() {
                fs::copy(&from, copy.join(folder).join(from.file_name().unwrap())).unwrap();
            }
        }
    }
    copy
}
