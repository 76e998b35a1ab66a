//! Text of a page: HTML that is also well-formed XML. Every text is escaped when written.

use picture::escaped;

/// Width of a picture on a screen and on paper, and on a phone, in px.
const WIDE: f64 = 900.0;
const NARROW: f64 = 344.0;

/// Number of columns that a phone has room for.
const MAX_NARROW_COLUMNS: usize = 3;

/// Styles of the page; those of the pictures follow.
const STYLE: &str = include_str!("page.css");

/// Page under construction.
#[derive(Debug, Default)]
pub(crate) struct Html {
    text: String,
    figures: usize,
}

/// Cell of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Cell {
    /// Words, aligned at the left.
    Text(String),
    /// Number, aligned at the right.
    Number(String),
    /// Name, path or checksum, in letters of one width.
    Code(String),
    /// Link within the page: its target, and its text.
    Link(String, String),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl Html {
    /// Writes a paragraph.
    pub(crate) fn paragraph(&mut self, text: &str) {
        self.element("p", "", text);
    }

    /// Writes a paragraph about missing content.
    pub(crate) fn missing(&mut self, text: &str) {
        self.element("p", "missing", text);
    }

    /// Writes a heading of the second level, which opens a section; [`end_section`](Self::end_section) closes it.
    pub(crate) fn section(&mut self, id: &str, heading: &str) {
        let id = escaped(id);
        self.text.push_str(&format!("<section id=\"{id}\" aria-labelledby=\"{id}-h\">"));
        self.text.push_str(&format!("<h2 id=\"{id}-h\">{}</h2>\n", escaped(heading)));
    }

    /// Closes a section.
    pub(crate) fn end_section(&mut self) {
        self.text.push_str("</section>\n");
    }

    /// Returns whether there is a section with this target of links.
    pub(crate) fn has_section(&self, id: &str) -> bool {
        self.text.contains(&format!("<section id=\"{}\"", escaped(id)))
    }

    /// Appends content that was written separately.
    pub(crate) fn append(&mut self, part: &Self) {
        self.text.push_str(&part.text);
        self.figures += part.figures;
    }

    /// Writes a link within the page.
    pub(crate) fn link(&mut self, aim: &str, text: &str) {
        self.text.push_str(&format!("<a href=\"#{}\">{}</a>", escaped(aim), escaped(text)));
    }

    /// Opens an element that is closed by [`close`](Self::close).
    pub(crate) fn open(&mut self, tag: &str, class: &str) {
        let class = escaped(class);
        self.text.push_str(&match &*class {
            "" => format!("<{tag}>"),
            class => format!("<{tag} class=\"{class}\">"),
        });
    }

    /// Closes an element.
    pub(crate) fn close(&mut self, tag: &str) {
        self.text.push_str(&format!("</{tag}>\n"));
    }

    /// Writes an element with its text.
    pub(crate) fn element(&mut self, tag: &str, class: &str, text: &str) {
        self.open(tag, class);
        self.text.push_str(&escaped(text));
        self.close(tag);
    }

    /// Writes a heading of the third level, with a target of links.
    pub(crate) fn subheading(&mut self, id: &str, text: &str) {
        self.text.push_str(&format!("<h3 id=\"{}\">{}</h3>\n", escaped(id), escaped(text)));
    }

    /// Writes names with their values.
    pub(crate) fn definitions(&mut self, rows: &[(&str, String)]) {
        self.text.push_str("<dl>");
        for (name, value) in rows {
            let (name, value) = (escaped(name), escaped(value));
            self.text.push_str(&format!("<div><dt>{name}</dt><dd>{value}</dd></div>"));
        }
        self.text.push_str("</dl>\n");
    }

    /// Writes a numbered list; text in backquotes is a command.
    pub(crate) fn steps(&mut self, steps: &[String]) {
        self.text.push_str("<ol>");
        for step in steps {
            self.text.push_str(&format!("<li>{}</li>", with_commands(step)));
        }
        self.text.push_str("</ol>\n");
    }

    /// Writes a paragraph; text in backquotes is a command.
    pub(crate) fn advice(&mut self, text: &str) {
        self.text.push_str(&format!("<p>{}</p>\n", with_commands(text)));
    }

    /// Opens a collapsed part with its name; [`close`](Self::close) ends it.
    pub(crate) fn details(&mut self, name: &str) {
        self.text.push_str(&format!("<details><summary>{}</summary>", escaped(name)));
    }

    /// Writes a table. The first cell of a row is its heading.
    pub(crate) fn table(&mut self, caption: &str, heads: &[&str], rows: &[Vec<Cell>]) {
        let class = if heads.len() > MAX_NARROW_COLUMNS { "long" } else { "short" };
        self.table_of(class, caption, heads, rows);
    }

    /// Writes a table of frames: a line each, whatever the width.
    pub(crate) fn log(&mut self, caption: &str, heads: &[&str], rows: &[Vec<Cell>]) {
        self.table_of("log", caption, heads, rows);
    }

    fn table_of(&mut self, class: &str, caption: &str, heads: &[&str], rows: &[Vec<Cell>]) {
        self.text.push_str("<div class=\"scroll\" role=\"region\" tabindex=\"0\" ");
        self.text.push_str(&format!(
            "aria-label=\"{0}\"><table class=\"{class}\"><caption>{0}</caption><thead><tr>",
            escaped(caption)
        ));
        for (place, head) in heads.iter().enumerate() {
            let is_number = rows
                .first()
                .and_then(|row| row.get(place))
                .is_some_and(|cell| matches!(cell, Cell::Number(_)));
            let class = if is_number { " class=\"n\"" } else { "" };
            self.text.push_str(&format!("<th scope=\"col\"{class}>{}</th>", escaped(head)));
        }
        self.text.push_str("</tr></thead><tbody>");
        for row in rows {
            self.text.push_str("<tr>");
            for (place, cell) in row.iter().enumerate() {
                self.cell(cell, heads.get(place).copied().unwrap_or_default(), place == 0);
            }
            self.text.push_str("</tr>");
        }
        self.text.push_str("</tbody></table></div>\n");
    }

    fn cell(&mut self, cell: &Cell, head: &str, is_heading: bool) {
        let (class, content) = match cell {
            Cell::Text(text) => ("", escaped(text)),
            Cell::Number(text) => (" class=\"n\"", escaped(text)),
            Cell::Code(text) => ("", format!("<code>{}</code>", escaped(text))),
            Cell::Link(aim, text) => {
                ("", format!("<a href=\"#{}\">{}</a>", escaped(aim), escaped(text)))
            }
        };
        self.text.push_str(&match is_heading {
            true => format!("<th scope=\"row\"{class}>{content}</th>"),
            // A phone shows the columns of a wide table below one another, each with its head.
            false => format!("<td{class} data-head=\"{}\">{content}</td>", escaped(head)),
        });
    }

    /// Writes a picture, drawn for screens and for phones, with its caption.
    pub(crate) fn figure(&mut self, draw: impl Fn(f64) -> String, caption: &str) {
        self.figures += 1;
        self.text.push_str("<figure><div class=\"wide\">");
        self.text.push_str(&draw(WIDE));
        self.text.push_str("</div><div class=\"narrow\">");
        self.text.push_str(&draw(NARROW));
        let number = self.figures;
        self.text.push_str(&format!(
            "</div><figcaption>Figure {number}. {}</figcaption></figure>\n",
            escaped(caption)
        ));
    }

    /// Returns the whole document with its head and styles, as XHTML.
    pub(crate) fn page(self, title: &str) -> String {
        let title = escaped(title);
        let body = self.text;
        format!(
            "<!DOCTYPE html>\n\
             <html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\" xml:lang=\"en\"><head><meta charset=\"utf-8\"/>\
             <title>{title}</title><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
             <meta name=\"color-scheme\" content=\"light dark\"/>\
             <link rel=\"icon\" href=\"data:,\"/>\
             <style>{STYLE}{}</style></head>\n<body>\n{body}</body></html>\n",
            picture::STYLE
        )
    }
}

/// Returns escaped text; text in backquotes becomes a command.
fn with_commands(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(place, part)| match place % 2 {
        0 => escaped(part),
        _ => format!("<code>{}</code>", escaped(part)),
    });
    parts.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_in_every_part_of_a_page() {
        let bad = "<script>\"&'";
        let mut html = Html::default();
        html.section(bad, bad);
        html.subheading(bad, bad);
        html.paragraph(bad);
        html.missing(bad);
        html.definitions(&[("name", bad.to_owned())]);
        html.steps(&[format!("{bad}`{bad}`")]);
        let cells = [Cell::Text, Cell::Number, Cell::Code].map(|cell| cell(bad.to_owned()));
        let link = Cell::Link(bad.to_owned(), bad.to_owned());
        html.table(bad, &[bad], &[cells.into_iter().chain([link]).collect()]);
        html.figure(|width| picture::strip::Strip::new(bad, 0.0..1.0).svg(width), bad);
        html.end_section();
        let page = html.page(bad);
        assert!(!page.contains("<script") && !page.contains("\"&'"), "{page}");
        assert!(page.matches("&lt;script&gt;").count() > 18, "{page}");
    }

    #[test]
    fn commands_stand_in_letters_of_one_width() {
        let mut html = Html::default();
        html.steps(&["say `frhc ctl reset` now".to_owned()]);
        assert!(html.page("").contains("<li>say <code>frhc ctl reset</code> now</li>"));
    }
}
