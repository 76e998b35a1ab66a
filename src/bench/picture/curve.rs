//! Curve: extremes of a value over time.

/// Least and greatest value between two times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Begin, in s.
    pub from: f64,
    /// End, in s.
    pub to: f64,
    /// Least value; NaN is a gap.
    pub min: f64,
    /// Greatest value; NaN is a gap.
    pub max: f64,
}

/// Curve with its name in the legend.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Extremes in the order of time.
    pub extents: Vec<Extent>,
    /// Number of its colour; [`Plot::new`](crate::strip::Plot::new) numbers its curves.
    pub colour: usize,
}

impl Curve {
    /// Creates a curve.
    pub fn new(name: impl Into<String>, extents: impl IntoIterator<Item = Extent>) -> Self {
        Self { name: name.into(), extents: extents.into_iter().collect(), colour: 0 }
    }
}
