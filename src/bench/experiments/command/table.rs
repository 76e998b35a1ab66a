//! Tables of an experiment, for a terminal and as Markdown.

use std::fmt::Write;

/// A table with its columns, and what is said above and below it.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// A line above the table, in lower case.
    pub(super) lead: Option<String>,
    /// Names of the columns.
    pub(super) columns: Vec<&'static str>,
    /// Rows, each with as many cells as there are columns.
    pub(super) rows: Vec<Vec<String>>,
    /// Meaning of the columns, below the table.
    pub(super) note: String,
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
    fn text(&self) -> String {
        let header: Vec<String> = self.columns.iter().map(ToString::to_string).collect();
        let lines = || [&header].into_iter().chain(&self.rows);
        let width = |column: usize| {
            let cells = lines().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..header.len()).map(width).collect();
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
            columns: vec!["arm", "force, N"],
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
    fn markdown_has_a_separator_and_full_sentences() {
        let expected = "Hands: firm.\n\n| arm | force, N |\n|---|---|\n| µ-arm | 1.0 |\n\nForce: at the hand.\n";
        assert_eq!(markdown(&[table()]), expected);
    }
}
