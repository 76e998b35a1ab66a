//! Comparison of two sessions: figures side by side, differences of their settings, and overlaid curves.

use std::ops::Range;

use crate::html::{Cell, Html};
use crate::sections::summary;
use crate::series::Series;
use crate::view::View;
use picture::strip::{Plot, Strip};

/// Height of a plot of a joint, in px.
const SMALL: f64 = 52.0;

/// Writes the comparison.
pub(crate) fn write(html: &mut Html, one: &View<'_>, other: &View<'_>) {
    html.section("comparison", "Comparison");
    let names = ["A", "B"];
    html.paragraph(&format!("A is {}; B is {}.", one.subject.name, other.subject.name));
    differences(html, one, other);
    figures(html, one, other);
    let engaged = [one, other].map(|view| view.gathered.first_engaged());
    let (zeros, aligned) = match engaged {
        [Some(one), Some(other)] => ([one, other], "Both begin at their first engagement."),
        [_, _] => ([0.0; 2], "Both begin at time zero, since one of them is never engaged."),
    };
    let views = [one, other];
    let time = time(views, zeros);
    let plot = |title: &str, unit: &str, of: &dyn Fn(&View<'_>) -> (Series, usize), scale: f64| {
        let curves = views.into_iter().zip(zeros).zip(names).map(|((view, zero), name)| {
            let (series, place) = of(view);
            series.curve(place, name, scale, zero)
        });
        Plot::new(title, unit, curves)
    };
    let joints = |of: &dyn Fn(&View<'_>) -> Series, is_torque: bool| -> Vec<Plot> {
        let units = one.units();
        let all = units.iter().enumerate().map(|(place, (name, position, torque))| {
            let unit = if is_torque { torque } else { position };
            let plot = plot(name, unit, &|view| (of(view), place), 1.0);
            Plot { has_zero: is_torque, height: SMALL, ..plot }
        });
        all.collect()
    };
    let pictures = [
        (
            "Forces and energy",
            vec![
                plot("force sensed", "N", &|view| (view.gathered.forces.clone(), 0), 1.0),
                plot("force felt", "N", &|view| (view.gathered.forces.clone(), 1), 1.0),
                plot("energy of the port", "mJ", &|view| (view.gathered.energy.clone(), 0), 1e3),
            ],
        ),
        ("Positions", joints(&|view| view.gathered.q.clone(), false)),
        ("Commanded torques", joints(&|view| view.gathered.tau.clone(), true)),
    ];
    for (title, plots) in pictures {
        let mut strip = Strip::new(format!("{title} of A and B over time"), time.clone());
        strip.plots = plots;
        html.figure(|width| strip.svg(width), &format!("{title} of A and B. {aligned}"));
    }
    html.end_section();
}

/// Returns the range of times of both, each relative to its zero.
fn time(views: [&View<'_>; 2], zeros: [f64; 2]) -> Range<f64> {
    let ends = views.into_iter().zip(zeros).map(|(view, zero)| {
        let time = view.time();
        (time.start - zero, time.end - zero)
    });
    let whole = ends.reduce(|(from, to), (other, end)| (from.min(other), to.max(end)));
    let (from, to) = whole.unwrap_or((0.0, 1.0));
    from..to
}

/// Writes the differences of the sessions themselves: program, configuration, files, joints.
fn differences(html: &mut Html, one: &View<'_>, other: &View<'_>) {
    let (Some(a), Some(b)) = (&one.subject.manifest, &other.subject.manifest) else {
        html.missing("One of them has no session.json: in what they differ is not known.");
        return;
    };
    let mut rows: Vec<Vec<Cell>> = Vec::new();
    let mut add = |what: &str, [a, b]: [String; 2]| {
        if a != b {
            rows.push(vec![what.into(), Cell::Code(a), Cell::Code(b)]);
        }
    };
    add("program", [&a.program, &b.program].map(Clone::clone));
    add("configuration", [&a.configuration, &b.configuration].map(Clone::clone));
    let optional = |path: &Option<String>| path.clone().unwrap_or_else(|| "none".to_owned());
    add("robot", [&a.robot, &b.robot].map(optional));
    add("scenario", [&a.scenario, &b.scenario].map(optional));
    add(
        "passivity layer",
        [a, b].map(|of| if of.without_passivity { "left out" } else { "as configured" }.to_owned()),
    );
    add("joints", [a, b].map(|of| of.joints.join(", ")));
    add("interfaces", [a, b].map(|of| of.interfaces.join(", ")));
    add("processor", [a, b].map(|of| of.host.processor.clone()));
    for file in &a.files {
        let same = b.files.iter().find(|one| one.path == file.path);
        add(
            &format!("content of {}", file.path),
            [
                file.sha256.clone(),
                same.map_or_else(|| "no such file".to_owned(), |same| same.sha256.clone()),
            ],
        );
    }
    for file in b.files.iter().filter(|file| a.files.iter().all(|one| one.path != file.path)) {
        add(&format!("content of {}", file.path), ["no such file".to_owned(), file.sha256.clone()]);
    }
    if rows.is_empty() {
        html.paragraph("Program, configuration, robot, scenario and all files are the same.");
    } else {
        html.table("What they were made with, where it differs", &["Part", "A", "B"], &rows);
    }
}

/// Writes the figures of both.
fn figures(html: &mut Html, one: &View<'_>, other: &View<'_>) {
    let (a, b) = (summary::computed(one), summary::computed(other));
    let mut names: Vec<&str> = a.iter().map(|(name, _)| *name).collect();
    names.extend(
        b.iter().map(|(name, _)| *name).filter(|name| a.iter().all(|(one, _)| one != name)),
    );
    let value = |of: &[(&'static str, String)], name: &str| {
        let found = of.iter().find(|(one, _)| *one == name);
        found.map_or_else(|| "\u{2013}".to_owned(), |(_, value)| value.clone())
    };
    let mut rows: Vec<Vec<Cell>> = names
        .into_iter()
        .map(|name| {
            let (a, b) = (value(&a, name), value(&b, name));
            let is_same = if a == b { "same" } else { "differs" };
            vec![name.into(), Cell::Number(a), Cell::Number(b), is_same.into()]
        })
        .collect();
    let stop = |view: &View<'_>| {
        let last = view.stops.iter().rev().find(|stop| stop.ended.is_none());
        last.map_or_else(|| "nothing".to_owned(), |stop| stop.cause.clone())
    };
    let (a, b) = (stop(one), stop(other));
    let is_same = if a == b { "same" } else { "differs" };
    rows.push(vec!["Stopped by".into(), a.into(), b.into(), is_same.into()]);
    html.table("Figures of both", &["Figure", "A", "B", "Equal"], &rows);
}
