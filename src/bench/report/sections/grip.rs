//! Wrenches, displacement and command, energy of the port, and the age of the commanded side's samples.

use crate::html::Html;
use crate::view::View;
use crate::words::with_unit;
use picture::strip::Plot;

const FORCES: [&str; 3] = ["fx", "fy", "fz"];
const MOMENTS: [&str; 3] = ["mx", "my", "mz"];
const AXES: [&str; 3] = ["x", "y", "z"];

/// Writes the wrenches: sensed, reflected, and all that acts at the grip.
pub(crate) fn wrenches(html: &mut Html, view: &View<'_>) {
    let gathered = view.gathered;
    html.section("wrenches", "Wrench sensed and felt");
    let plots = [
        Plot::new("force sensed", "N", gathered.f_s.curves(0, &FORCES, 1.0)),
        Plot {
            height: 64.0,
            ..Plot::new("moment sensed", "N·m", gathered.f_s.curves(3, &MOMENTS, 1.0))
        },
    ];
    let picture = view.strip("Wrench sensed over time, force and moment", plots);
    html.figure(
        |width| picture.svg(width),
        "Wrench of the environment on the object at the sensor {S}, payload removed (f_s).",
    );
    if !gathered.has_replay() {
        html.missing(&view.without_replay("The wrenches at the grip"));
        html.end_section();
        return;
    }
    let names = ["task", "passivity", "return to centre", "damping"];
    let plots = [
        Plot::new("force felt", "N", gathered.f_g_task.curves(0, &FORCES, 1.0)),
        Plot {
            height: 64.0,
            ..Plot::new("moment felt", "N·m", gathered.f_g_task.curves(3, &MOMENTS, 1.0))
        },
        Plot::new("forces at the grip, magnitude", "N", gathered.grip.curves(0, &names, 1.0)),
    ];
    let picture = view.strip("Wrench felt at the grip over time, and all that acts there", plots);
    html.figure(
        |width| picture.svg(width),
        "Wrench of the task on the hand at the grip {G} (f_g_task), and the magnitudes of all forces that the law asks for there, before the joints' limits.",
    );
    html.end_section();
}

/// Writes displacement and command.
pub(crate) fn commands(html: &mut Html, view: &View<'_>) {
    let gathered = view.gathered;
    html.section("commands", "Displacement and command");
    if !gathered.has_replay() {
        html.missing(&view.without_replay("Displacement and command"));
        html.end_section();
        return;
    }
    let mut plots = vec![
        Plot::new("displacement", "mm", gathered.dx.curves(0, &AXES, 1e3)),
        Plot {
            height: 64.0,
            ..Plot::new("displacement, angles", "rad", gathered.dx.curves(3, &["γ", "β", "α"], 1.0))
        },
    ];
    let rate = &gathered.rate;
    if (0..6).any(|place| rate.is_used(place)) {
        plots.push(Plot::new("rate command", "mm/s", rate.curves(0, &AXES, 1e3)));
        plots.push(Plot {
            height: 64.0,
            ..Plot::new("rate command, angular", "rad/s", rate.curves(3, &AXES, 1.0))
        });
    }
    if !gathered.pose.is_empty() {
        let curves = gathered.pose.curves(0, &AXES, 1e3);
        plots.push(Plot { has_zero: false, ..Plot::new("pose command, position", "mm", curves) });
    }
    let curves = gathered.object.curves(0, &AXES, 1e3);
    plots.push(Plot { has_zero: false, ..Plot::new("position of the object", "mm", curves) });
    let picture = view.strip("Displacement of the grip, command and object over time", plots);
    html.figure(
        |width| picture.svg(width),
        "Displacement of the grip from its reference (Eq. 4), the command that follows from it (Eq. 5, 3.5), and the object under control in its base {b}.",
    );
    html.end_section();
}

/// Writes the energy of the port.
pub(crate) fn energy(html: &mut Html, view: &View<'_>) {
    let gathered = view.gathered;
    html.section("energy", "Energy of the port");
    if !gathered.has_replay() {
        html.missing(&view.without_replay("Energies"));
    } else if gathered.energy.is_empty() {
        html.paragraph(
            "The configuration has no passivity layer, and so no account of the port's energy.",
        );
    } else {
        let mut curves = gathered.energy.curves(0, &["port", "tank"], 1e3);
        if gathered.energy.range(1).is_none() {
            curves.truncate(1);
        }
        let activity = gathered.activity.curve(0, "activity", 1.0, 0.0);
        let plots = [
            Plot::new("energy", "mJ", curves),
            Plot { height: 48.0, ..Plot::new("activity of the passivity layer", "", [activity]) },
        ];
        let picture = view.strip("Energy of the reflection port over time", plots);
        html.figure(
            |width| picture.svg(width),
            "Energy from the hand into the reflection port less energy out of it, and how much the passivity layer does, 0 to 1. Below zero, the port has given more than it got.",
        );
        if let Some([lowest, last]) = gathered.figures.energy {
            html.paragraph(&format!(
                "Lowest {}, last {}.",
                with_unit(lowest * 1e3, "mJ"),
                with_unit(last * 1e3, "mJ")
            ));
        }
    }
    html.end_section();
}

/// Writes the age of samples, where there are any.
pub(crate) fn link(html: &mut Html, view: &View<'_>) {
    let gathered = view.gathered;
    html.section("link", "Age of the commanded side\u{2019}s samples");
    if gathered.sample_age.is_empty() {
        let text = if gathered.has_replay() {
            "No sample of a commanded side was recorded.".to_owned()
        } else {
            view.without_replay("Ages of samples")
        };
        html.missing(&text);
    } else if gathered.sample_age.is_used(0) {
        let curve = gathered.sample_age.curve(0, "age", 1e3, 0.0);
        let picture = view.strip(
            "Age of the newest sample over time",
            [Plot::new("age of the newest sample", "ms", [curve])],
        );
        html.figure(|width| picture.svg(width), "Age at SYNC of the newest sample of the commanded side: wrench and pose. It rises while samples are missing.");
        if let Some(age) = gathered.figures.sample_age {
            html.paragraph(&format!("Oldest sample used: {}.", with_unit(age * 1e3, "ms")));
        }
    } else {
        html.paragraph("Every sample was taken at its SYNC: the commanded side is in the same process, without a link.");
    }
    html.end_section();
}
