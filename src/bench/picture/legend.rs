//! Heading of a plot: its title, and the names of its curves, in as many rows as necessary.

use crate::ink::{Canvas, width_of};

/// Height of a row, in px.
pub(crate) const ROW: f64 = 17.0;

/// Width of a swatch with its gap, in px.
const SWATCH: f64 = 17.0;

/// Width of bold letters, as a multiple of others.
const BOLD: f64 = 1.22;

/// Gap between two entries, in px.
const GAP: f64 = 12.0;

/// Title and entries with their places.
#[derive(Debug)]
pub(crate) struct Legend<'a> {
    title: &'a str,
    entries: Vec<(&'a str, usize, f64, f64)>,
    rows: f64,
}

impl<'a> Legend<'a> {
    /// Places the title, and each entry with its colour, within this width.
    pub(crate) fn new(
        title: &'a str,
        entries: impl IntoIterator<Item = (&'a str, usize)>,
        width: f64,
    ) -> Self {
        let (mut x, mut row) = (width_of(title) * BOLD + GAP, 0.0);
        let mut placed = Vec::new();
        for (name, colour) in entries {
            let taken = SWATCH + width_of(name);
            if x > 0.0 && x + taken > width {
                (x, row) = (0.0, row + 1.0);
            }
            placed.push((name, colour, x, row));
            x += taken + GAP;
        }
        Self { title, entries: placed, rows: row + 1.0 }
    }

    /// Returns the height of the heading, in px.
    pub(crate) fn height(&self) -> f64 {
        self.rows * ROW
    }

    /// Draws the heading with its upper left corner at this point.
    pub(crate) fn draw(&self, canvas: &mut Canvas, [left, top]: [f64; 2]) {
        canvas.text("t", [left, top + 12.0], self.title);
        for (name, colour, x, row) in &self.entries {
            let (x, y) = (left + x, top + row * ROW);
            canvas.rect(&format!("a s c{colour}"), [x, y + 6.0], [12.0, 4.0]);
            canvas.text("", [x + SWATCH, y + 12.0], name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_wrap_where_the_width_ends() {
        let names = ["task", "gravity", "centring", "damping"].map(|name| (name, 0));
        assert!((Legend::new("elbow", names, 900.0).height() - ROW).abs() < 1e-9);
        assert!(Legend::new("elbow", names, 200.0).height() > ROW);
    }
}
