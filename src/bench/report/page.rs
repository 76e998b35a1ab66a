//! Page: a pass over the cycles of its sessions, and the sections in their order.

use serde_json::Value;

use crate::compare;
use crate::gather::{LogAlone, SessionData};
use crate::html::Html;
use crate::sections::{boot, bus, fault_frames, grip, joints, parts, summary, timing, verdict};
use crate::stops;
use crate::subject::Subject;
use crate::view::View;
use crate::words::{duration, moment};
use signals::{Recording, WireCycles};
use telemetry::manifest::SessionKind;

/// Sections that the page links to, in their order.
const CONTENTS: [(&str, &str); 16] = [
    ("verdict", "Verdict"),
    ("comparison", "Comparison"),
    ("stops", "Stops"),
    ("trip", "At the trip"),
    ("modes", "Modes"),
    ("summary", "Summary"),
    ("positions", "Positions"),
    ("torques", "Torques"),
    ("wrenches", "Wrenches"),
    ("commands", "Commands"),
    ("energy", "Energy"),
    ("link", "Link"),
    ("timing", "Timing"),
    ("load", "Bus load"),
    ("boot", "Boot"),
    ("parts", "Files and replay"),
];

/// Error of a report that was abandoned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interruption;

/// Report as text.
#[derive(Clone, Debug)]
pub struct Page {
    /// One HTML file.
    pub html: String,
    /// Parts that are missing or cannot be read, a sentence each. The page has them, too.
    pub remarks: Vec<String>,
}

/// Returns the report of a session or fault record, compared with another one. `on_progress` gets the number of cycles that
/// were read since the last call, and returns whether to go on.
///
/// # Errors
/// Returns an error if `on_progress` has returned false.
pub fn report(
    subject: &Subject,
    other: Option<&Subject>,
    mut on_progress: impl FnMut(u64) -> bool,
) -> Result<Page, Interruption> {
    let gathered = gather(subject, &mut on_progress).ok_or(Interruption)?;
    let compared = match other {
        Some(other) => Some((other, gather(other, &mut on_progress).ok_or(Interruption)?)),
        None => None,
    };
    let (found, names) = (stops::stops(subject, &gathered.modes.stops), subject.joints());
    let view = View { subject, gathered: &gathered, stops: &found, joints: &names };
    let mut html = Html::default();
    let title = match other {
        Some(other) => format!("{} compared with {}", title(&view), other.name),
        None => title(&view),
    };
    let mut body = Html::default();
    body.open("main", "");
    verdict::write(&mut body, &view);
    if let Some((subject, gathered)) = &compared {
        let (found, names) = (stops::stops(subject, &gathered.modes.stops), subject.joints());
        let other = View { subject, gathered, stops: &found, joints: &names };
        compare::write(&mut body, &view, &other);
    }
    sections(&mut body, &view);
    body.close("main");
    head(&mut html, &view, &title, &body);
    html.append(&body);
    html.element(
        "footer",
        "",
        &format!(
            "Made by frhc report {}. All times count from time zero of the session.",
            env!("CARGO_PKG_VERSION")
        ),
    );
    let others = compared.iter().map(|(_, gathered)| gathered);
    let all = std::iter::once(&gathered).chain(others);
    let remarks = all.flat_map(|gathered| gathered.findings.remarks.iter().cloned()).collect();
    Ok(Page { html: html.page(&title), remarks })
}

/// Writes the sections after the verdict.
fn sections(html: &mut Html, view: &View<'_>) {
    if view.gathered.figures.cycles == 0 {
        verdict::stops(html, view);
        fault_frames::write(html, view);
        summary::write(html, view);
        parts::write(html, view);
        return;
    }
    verdict::stops(html, view);
    fault_frames::write(html, view);
    verdict::timeline(html, view);
    summary::write(html, view);
    joints::positions(html, view);
    joints::torques(html, view);
    grip::wrenches(html, view);
    if !view.subject.is_record() {
        grip::commands(html, view);
        grip::energy(html, view);
        grip::link(html, view);
        timing::write(html, view);
    }
    bus::write(html, view);
    if !view.subject.is_record() {
        boot::write(html, view);
    }
    parts::write(html, view);
}

/// Writes title, facts, and links to the sections that exist.
fn head(html: &mut Html, view: &View<'_>, title: &str, body: &Html) {
    html.open("header", "");
    html.element("h1", "", title);
    html.element("p", "meta", &facts(view));
    html.open("nav", "");
    html.open("ul", "");
    for (id, name) in CONTENTS.into_iter().filter(|(id, _)| body.has_section(id)) {
        html.open("li", "");
        html.link(id, name);
        html.close("li");
    }
    html.close("ul");
    html.close("nav");
    html.close("header");
}

fn title(view: &View<'_>) -> String {
    let what = if view.subject.is_record() { "Fault record" } else { "Session" };
    format!("{what} {}", view.subject.name)
}

/// Returns time, program and configuration of the recording.
fn facts(view: &View<'_>) -> String {
    let mut facts = Vec::new();
    let manifest = view.subject.manifest.as_ref();
    let summary = view.subject.summary.as_ref().or(view.subject.fault.as_ref());
    let utc = summary.and_then(|summary| summary.get("origin")?.get("utc").and_then(Value::as_str));
    match manifest.map(|manifest| manifest.kind) {
        Some(SessionKind::Demo) => facts.push("simulated by frhc demo, in virtual time".to_owned()),
        Some(SessionKind::Campaign) => {
            facts.push("simulated by frhc campaign, in virtual time".to_owned());
        }
        Some(SessionKind::Run) => {
            facts.push("recorded by frhc run".to_owned());
            facts.extend(utc.map(|utc| format!("time zero {utc}")));
        }
        None => facts.extend(utc.map(|utc| format!("time zero {utc}"))),
    }
    if let Some([first, last]) = view.gathered.ends {
        let cycles = format!("{} of cycles, from {}", duration(last - first), moment(first));
        facts.push(cycles);
    }
    facts.extend(manifest.map(|manifest| manifest.program.clone()));
    facts.extend(manifest.map(|manifest| manifest.configuration.clone()));
    facts.extend(manifest.and_then(|manifest| manifest.scenario.clone()));
    facts.extend(manifest.and_then(|manifest| manifest.robot.clone()));
    facts.join(" · ")
}

/// Reads the cycles of a subject: with the replay where there is one, else by the log alone, else none.
fn gather(subject: &Subject, on_progress: impl FnMut(u64) -> bool) -> Option<SessionData> {
    let interfaces = subject.interfaces();
    let buses = interfaces.len();
    let config = subject.config.as_ref();
    if let (Some(session), Some(config)) = (&subject.session, config) {
        return match Recording::new(session, config).cycles() {
            Ok(mut cycles) => SessionData::read(&mut cycles, buses, on_progress),
            Err(error) => Some(SessionData::without(error.to_string())),
        };
    }
    let reason = match (subject.is_record(), &subject.session) {
        (true, _) => "a fault record has no inputs",
        (false, Some(_)) => "the configuration of the session cannot be read",
        (false, None) => {
            "the description of the session, or a file that it has copied, is not whole"
        }
    };
    match subject.log() {
        Ok(log) => {
            let log = WireCycles::new(log, &interfaces, subject.origin_us(), config);
            SessionData::read(&mut LogAlone::new(log, reason), buses, on_progress)
        }
        Err(error) => Some(SessionData::without(error.to_string())),
    }
}
