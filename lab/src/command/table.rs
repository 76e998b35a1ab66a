//! Tables of an experiment, for a terminal and as Markdown, and its rows as CSV.

use std::fmt::Write;

use serde::Serialize;

/// Name of a column, and the function that returns its cell of a row.
pub(super) type Column<R> = (&'static str, fn(&R) -> String);

/// Table with a title line above and a note below.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// Title line above the table, in lower case.
    pub(super) lead: Option<String>,
    /// Names of the columns.
    pub(super) columns: Vec<String>,
    /// Rows, each with as many cells as there are columns.
    pub(super) rows: Vec<Vec<String>>,
    /// Meaning of the columns, below the table.
    pub(super) note: String,
}

/// Returns `rows` as CSV below the comma-separated names of `head`. Structs and lists in a row are flattened.
///
/// # Errors
/// Returns an error if the number of values of a row is not that of the names.
pub(super) fn csv(
    head: &str,
    rows: impl IntoIterator<Item = impl Serialize>,
) -> anyhow::Result<String> {
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    writer.write_record(head.split(','))?;
    rows.into_iter().try_for_each(|row| writer.serialize(row))?;
    Ok(String::from_utf8(writer.into_inner()?)?)
}

/// Returns the tables for a terminal, a blank line between them.
pub(super) fn text(tables: &[Table]) -> String {
    tables.iter().map(Table::text).collect::<Vec<_>>().join("\n\n")
}

/// Returns the tables as Markdown.
pub(super) fn markdown(tables: &[Table]) -> String {
    tables.iter().map(Table::markdown).collect::<Vec<_>>().join("\n")
}

impl Table {
    /// Creates a table of `rows`; `note` explains the columns.
    pub(super) fn new<R, const N: usize>(
        rows: impl IntoIterator<Item = R>,
        columns: [Column<R>; N],
        note: impl Into<String>,
    ) -> Self {
        let cells = |row: R| columns.iter().map(|(_, cell)| cell(&row)).collect();
        let rows = rows.into_iter().map(cells).collect();
        let columns = columns.map(|(name, _)| name.to_owned()).to_vec();
        Self { lead: None, columns, rows, note: note.into() }
    }

    /// Returns the table with a title line.
    pub(super) fn below(self, lead: impl Into<String>) -> Self {
        Self { lead: Some(lead.into()), ..self }
    }

    fn text(&self) -> String {
        let lines = || [&self.columns].into_iter().chain(&self.rows);
        let width = |column: usize| {
            let cells = lines().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut text = String::new();
        if let Some(lead) = &self.lead {
            _ = writeln!(text, "{lead}");
        }
        for row in lines() {
            let cells = row.iter().zip(&widths);
            let line: Vec<String> = cells.map(|(cell, width)| format!("{cell:width$}")).collect();
            _ = writeln!(text, "{}", line.join("  ").trim_end());
        }
        text + &self.note
    }

    fn markdown(&self) -> String {
        let mut text = String::new();
        if let Some(lead) = &self.lead {
            _ = writeln!(text, "{}.\n", capitalised(lead));
        }
        _ = writeln!(text, "| {} |", self.columns.join(" | "));
        _ = writeln!(text, "|{}", "---|".repeat(self.columns.len()));
        for row in &self.rows {
            _ = writeln!(text, "| {} |", row.join(" | "));
        }
        format!("{text}\n{}.\n", capitalised(&self.note))
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        Table {
            lead: Some("hands: firm".to_owned()),
            columns: ["arm", "force, N"].map(str::to_owned).to_vec(),
            rows: vec![vec!["µ-arm".to_owned(), "1.0".to_owned()]],
            note: "force: at the hand".to_owned(),
        }
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let expected = "hands: firm\narm    force, N\nµ-arm  1.0\nforce: at the hand";
        assert_eq!(text(&[table()]), expected);
    }

    #[test]
    fn csv_has_a_field_for_each_value_of_a_row() {
        let rows = [("a, b", [1.0, 2.5e-9], None::<f64>), ("c", [0.0, 1.0], Some(0.1))];
        let expected = "arm,x_n,y_n,rest_n\n\"a, b\",1.0,2.5e-9,\nc,0.0,1.0,0.1\n";
        assert_eq!(csv("arm,x_n,y_n,rest_n", rows).unwrap(), expected);
        assert!(csv("arm,x_n,y_n", rows).is_err());
    }

    #[test]
    fn markdown_has_a_separator_and_full_sentences() {
        let expected = "Hands: firm.\n\n| arm | force, N |\n|---|---|\n| µ-arm | 1.0 |\n\nForce: at the hand.\n";
        assert_eq!(markdown(&[table()]), expected);
    }
}
