//! Charts of experiments and calibrations: lines, marks and areas in panels, in rows.

use std::ops::Range;

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::{Circle, IntoDynElement, PathElement, Polygon, Rectangle};
use plotters::prelude::{
    BLACK, Cartesian2d, ChartBuilder, ChartContext, Color, DashedLineSeries, DrawingArea,
    IntoDrawingArea, IntoFont, IntoTextStyle, RGBColor, SVGBackend, SeriesLabelPosition, WHITE,
};

use crate::theme::standalone;

/// Width and height of a panel, in px.
const PANEL: [u32; 2] = [560, 320];

/// Opacity of an area.
const BAND: f64 = 0.2;

/// Width and height of the corner that a legend takes, as shares of the chart.
const LEGEND: [f64; 2] = [0.4, 0.4];

/// Height of a line of the notes, in px.
const NOTE_HEIGHT: i32 = 18;

/// Room above the marks of named places, as a share of their range.
const ROOM: f64 = 0.5;

/// Colours of the series of a panel, in order: dark, and apart for people who do not see all colours.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0x16, 0x63, 0xa8),
    RGBColor(0xc0, 0x4a, 0x12),
    RGBColor(0x2a, 0x8a, 0x4a),
    RGBColor(0x7a, 0x3d, 0x9c),
    RGBColor(0x22, 0x22, 0x22),
    RGBColor(0xa8, 0x84, 0x10),
];

/// Drawing of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Solid through the points.
    Line,
    /// Dashed through the points.
    Dashed,
    /// Mark at each point.
    Marks,
    /// Ring around each point.
    Rings,
    /// Area that the points enclose.
    Band,
}

/// Curve with its name in the legend.
#[derive(Debug)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Line or marks of the points.
    pub ink: Ink,
    /// Points, in the units of the axes; a line has a gap where one is NaN.
    pub points: Vec<[f64; 2]>,
}

impl Series {
    /// Creates a curve.
    pub fn new(
        name: impl Into<String>,
        ink: Ink,
        points: impl IntoIterator<Item = [f64; 2]>,
    ) -> Self {
        Self { name: name.into(), ink, points: points.into_iter().collect() }
    }
}

/// Chart with two axes.
#[derive(Debug)]
pub struct Panel {
    /// Heading above the chart.
    pub title: String,
    /// Names of the axes, with units.
    pub axes: [String; 2],
    /// Names of the places 1, 2, … on the axis across, instead of numbers; none for numbers.
    pub places: Vec<String>,
    /// Its curves; the colours are those of their places.
    pub series: Vec<Series>,
    /// Lines of text below the title.
    pub notes: Vec<String>,
}

impl Panel {
    /// Creates a chart whose places are numbers.
    pub fn new(
        title: impl Into<String>,
        axes: [&str; 2],
        series: impl IntoIterator<Item = Series>,
    ) -> Self {
        let series = series.into_iter().collect();
        let axes = axes.map(str::to_owned);
        Self { title: title.into(), axes, places: Vec::new(), series, notes: Vec::new() }
    }
}

/// Chart that is being drawn.
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Returns the panels as one SVG picture, in rows of `columns`, with its stylesheet.
///
/// # Errors
/// Returns an error if the picture cannot be drawn.
pub fn svg(panels: &[Panel], columns: usize) -> anyhow::Result<String> {
    Ok(standalone(&plain(panels, columns)?))
}

/// Returns the picture without a stylesheet.
pub(crate) fn plain(panels: &[Panel], columns: usize) -> anyhow::Result<String> {
    let columns = columns.clamp(1, panels.len().max(1));
    let rows = panels.len().div_ceil(columns).max(1);
    let [width, height] = PANEL;
    let size = (width * u32::try_from(columns)?, height * u32::try_from(rows)?);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).map_err(drawn)?;
        for (area, panel) in root.split_evenly((rows, columns)).iter().zip(panels) {
            draw(area, panel)?;
        }
        root.present().map_err(drawn)?;
    }
    Ok(text)
}

fn draw(area: &DrawingArea<SVGBackend<'_>, Shift>, panel: &Panel) -> anyhow::Result<()> {
    let points = || panel.series.iter().flat_map(|series| &series.points);
    let across = match panel.places.len() {
        0 => range(points().map(|[x, _]| *x)),
        places => 0.5..f64::from(u32::try_from(places)?) + 0.5,
    };
    let mut up = range(points().map(|[_, y]| *y));
    if !panel.places.is_empty() {
        // Room for the legend above marks that stand in every corner.
        up.end += ROOM * (up.end - up.start);
    }
    let ranges = [across, up];
    let corner = emptiest(&points(), &ranges);
    let [x, y] = &panel.axes;
    let [across, up] = ranges;
    let area = area.titled(&panel.title, ("sans-serif", 16).into_font()).map_err(drawn)?;
    let area = noted(&area, panel)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .x_label_area_size(38)
        .y_label_area_size(54)
        .build_cartesian_2d(across, up)
        .map_err(drawn)?;
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(WHITE).x_desc(x).y_desc(y).axis_desc_style(("sans-serif", 13));
    mesh.x_labels(8).y_labels(7);
    let named = |x: &f64| name(&panel.places, *x);
    if !panel.places.is_empty() {
        mesh.x_label_formatter(&named);
    }
    mesh.draw().map_err(drawn)?;
    for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
        add(&mut chart, series, *colour)?;
    }
    let mut labels = chart.configure_series_labels();
    labels.position(corner).label_font(("sans-serif", 12));
    labels.border_style(BLACK.mix(0.3)).background_style(WHITE.mix(0.85)).draw().map_err(drawn)
}

/// Writes the notes below the title; returns the rest of the area.
fn noted<'a>(
    area: &DrawingArea<SVGBackend<'a>, Shift>,
    panel: &Panel,
) -> anyhow::Result<DrawingArea<SVGBackend<'a>, Shift>> {
    let mut rest = area.clone();
    for note in &panel.notes {
        let (row, below) = rest.split_vertically(NOTE_HEIGHT);
        let style = ("sans-serif", 12).into_text_style(area);
        row.draw_text(note, &style, (14, 6)).map_err(drawn)?;
        rest = below;
    }
    Ok(rest)
}

fn add<'b: 'a, 'a>(
    chart: &mut Chart<'a, 'b>,
    series: &Series,
    colour: RGBColor,
) -> anyhow::Result<()> {
    let points = series.points.iter().map(|[x, y]| (*x, *y));
    let line = colour.stroke_width(2);
    let drawing = match series.ink {
        Ink::Line => {
            let parts = series.points.split(|[x, y]| !(x.is_finite() && y.is_finite()));
            let parts = parts.map(|part| part.iter().map(|[x, y]| (*x, *y)).collect::<Vec<_>>());
            let lines =
                parts.filter(|part| part.len() > 1).map(|part| PathElement::new(part, line));
            chart.draw_series(lines).map_err(drawn)?
        }
        Ink::Dashed => {
            chart.draw_series(DashedLineSeries::new(points, 6, 4, line)).map_err(drawn)?
        }
        Ink::Marks => {
            let marks = points.map(|point| Circle::new(point, 3, colour.filled()));
            chart.draw_series(marks).map_err(drawn)?
        }
        Ink::Rings => {
            let rings = points.map(|point| Circle::new(point, 6, line));
            chart.draw_series(rings).map_err(drawn)?
        }
        Ink::Band => {
            let area = Polygon::new(points.collect::<Vec<_>>(), colour.mix(BAND));
            chart.draw_series([area]).map_err(drawn)?
        }
    };
    let ink = series.ink;
    drawing.label(&series.name).legend(move |(x, y)| match ink {
        Ink::Line => PathElement::new([(x, y), (x + 18, y)], line).into_dyn(),
        Ink::Dashed => PathElement::new([(x, y), (x + 8, y)], line).into_dyn(),
        Ink::Marks => Circle::new((x + 9, y), 3, colour.filled()).into_dyn(),
        Ink::Rings => Circle::new((x + 9, y), 5, line).into_dyn(),
        Ink::Band => {
            Rectangle::new([(x, y - 4), (x + 18, y + 4)], colour.mix(BAND).filled()).into_dyn()
        }
    });
    Ok(())
}

/// Returns the name of the place at `x`; none between two places.
fn name(places: &[String], x: f64) -> String {
    let named = (1_u32..).zip(places).find(|(place, _)| (x - f64::from(*place)).abs() < 1e-6);
    named.map(|(_, name)| name.clone()).unwrap_or_default()
}

/// Returns the corner for the legend: the one with the fewest points.
fn emptiest<'p>(
    points: &(impl Iterator<Item = &'p [f64; 2]> + Clone),
    [across, up]: &[Range<f64>; 2],
) -> SeriesLabelPosition {
    let part = |range: &Range<f64>, value: f64| (value - range.start) / (range.end - range.start);
    let corners = [
        (SeriesLabelPosition::UpperRight, [false, false]),
        (SeriesLabelPosition::UpperLeft, [true, false]),
        (SeriesLabelPosition::LowerRight, [false, true]),
        (SeriesLabelPosition::LowerLeft, [true, true]),
    ];
    let crowd = |[is_left, is_low]: [bool; 2]| {
        let is_within = |[x, y]: &&[f64; 2]| {
            let (x, y) = (part(across, *x), part(up, *y));
            let (x, y) = (if is_left { x } else { 1.0 - x }, if is_low { y } else { 1.0 - y });
            x < LEGEND[0] && y < LEGEND[1]
        };
        points.clone().filter(is_within).count()
    };
    let best = corners.into_iter().min_by_key(|(_, corner)| crowd(*corner));
    best.map_or(SeriesLabelPosition::UpperRight, |(position, _)| position)
}

/// Returns the range of the values and zero, with a margin of 8 %.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) =
        finite.fold((0.0_f64, 0.0_f64), |(low, high), one| (low.min(one), high.max(one)));
    let margin = if high > low { 0.08 * (high - low) } else { 1.0 };
    let low = if low < 0.0 { low - margin } else { 0.0 };
    low..high + margin
}

/// Returns the text of a drawing's error, as its own type borrows the picture.
fn drawn(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("cannot draw the picture: {error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_contain_zero_and_all_finite_values() {
        assert_eq!(range([2.0, 10.0, f64::NAN].into_iter()), 0.0..10.8);
        assert_eq!(range([-1.0, 1.0].into_iter()), -1.16..1.16);
        assert_eq!(range([].into_iter()), 0.0..1.0);
    }

    #[test]
    fn places_are_named_instead_of_numbered() {
        let panel = Panel {
            title: "work".to_owned(),
            axes: ["operator", "J"].map(str::to_owned),
            notes: Vec::new(),
            places: vec!["steady".to_owned(), "firm".to_owned()],
            series: vec![Series::new("both", Ink::Marks, vec![[1.0, 1.0], [2.0, 2.0]])],
        };
        let text = svg(&[panel], 1).unwrap();
        assert!(text.contains("steady") && text.contains("firm"), "{text}");
    }

    #[test]
    fn legend_is_where_the_curve_is_not() {
        let rising: Vec<[f64; 2]> = [0.0, 1.0, 2.0, 3.0].map(|x| [x, x]).to_vec();
        let falling: Vec<[f64; 2]> = rising.iter().map(|[x, y]| [*x, 3.0 - y]).collect();
        let corner = |points: &[[f64; 2]]| emptiest(&points.iter(), &[0.0..3.0, 0.0..3.0]);
        assert!(matches!(corner(&rising), SeriesLabelPosition::UpperLeft));
        assert!(matches!(corner(&falling), SeriesLabelPosition::UpperRight));
    }

    #[test]
    fn picture_has_every_title_axis_and_series() {
        let panel = |title: &str| Panel {
            title: title.to_owned(),
            axes: ["mm", "N"].map(str::to_owned),
            notes: Vec::new(),
            places: Vec::new(),
            series: vec![
                Series::new("felt", Ink::Line, vec![[0.0, 1.0], [0.5, f64::NAN], [1.0, 2.0]]),
                Series::new("law", Ink::Dashed, vec![[0.0, 1.0], [1.0, 1.0]]),
                Series::new("measured", Ink::Marks, vec![[0.5, 1.5]]),
            ],
        };
        let text = svg(&[panel("first"), panel("second"), panel("third")], 2).unwrap();
        assert!(text.contains("width=\"1120\" height=\"640\""), "{}", &text[..200]);
        for written in ["first", "third", "mm", "felt", "law", "measured"] {
            assert!(text.contains(written), "{written}");
        }
        assert!(!text.contains("NaN"));
    }
}
