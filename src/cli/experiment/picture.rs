//! Picture of an experiment: the force that the hand feels over the one that it should feel.

use anyhow::anyhow;
use plotters::prelude::{
    BLACK, ChartBuilder, Color, IntoDrawingArea, IntoFont, LineSeries, RGBColor, SVGBackend, WHITE,
};

/// Width of the picture and height of a panel, in px.
const WIDTH: u32 = 900;
const HEIGHT: u32 = 300;

/// Colour of the felt force.
const FELT: RGBColor = RGBColor(0x16, 0x63, 0xa8);

/// Colour of the wanted force.
const WANTED: RGBColor = RGBColor(0xc0, 0x4a, 0x12);

/// Forces of one run over time.
#[derive(Debug)]
pub(super) struct Panel {
    /// Title.
    pub(super) title: String,
    /// Time in s, wanted and felt force in N.
    pub(super) forces: Vec<[f64; 3]>,
}

/// Returns the picture as SVG, the panels below each other.
pub(super) fn svg(panels: &[Panel]) -> anyhow::Result<String> {
    let mut text = String::new();
    let count = u32::try_from(panels.len())?;
    {
        let height = HEIGHT * count.max(1);
        let root = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE).map_err(drawn)?;
        for (area, panel) in root.split_evenly((panels.len().max(1), 1)).iter().zip(panels) {
            let [first, last] = [panel.forces.first(), panel.forces.last()]
                .map(|one| one.map_or(0.0, |[t, ..]| *t));
            let sizes = panel.forces.iter().flat_map(|[_, wanted, felt]| [*wanted, *felt]);
            let most = sizes.fold(1.0, f64::max) * 1.1;
            let mut chart = ChartBuilder::on(area)
                .caption(&panel.title, ("sans-serif", 16).into_font())
                .margin(8)
                .x_label_area_size(34)
                .y_label_area_size(44)
                .build_cartesian_2d(first..last.max(first + 1.0), 0.0..most)
                .map_err(drawn)?;
            chart
                .configure_mesh()
                .light_line_style(WHITE)
                .x_desc("s")
                .y_desc("N")
                .draw()
                .map_err(drawn)?;
            let line = |value: fn(&[f64; 3]) -> f64| {
                panel.forces.iter().map(move |one| (one[0], value(one)))
            };
            let series = [
                ("force at the hand", FELT, line(|[.., felt]| *felt)),
                ("K_T times the sensed force", WANTED, line(|[_, wanted, _]| *wanted)),
            ];
            for (name, colour, points) in series {
                let drawing = chart.draw_series(LineSeries::new(points, colour.stroke_width(1)));
                drawing.map_err(drawn)?.label(name).legend(move |(x, y)| {
                    plotters::element::PathElement::new(
                        [(x, y), (x + 18, y)],
                        colour.stroke_width(2),
                    )
                });
            }
            let labels = chart
                .configure_series_labels()
                .border_style(BLACK.mix(0.3))
                .background_style(WHITE)
                .draw();
            labels.map_err(drawn)?;
        }
        root.present().map_err(drawn)?;
    }
    Ok(text)
}

/// The error of a drawing, in words: its own type borrows the picture.
fn drawn(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("cannot draw the picture: {error}")
}
