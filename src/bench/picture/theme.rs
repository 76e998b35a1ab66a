//! Light and dark colours of pictures, as a stylesheet for a page or a separate picture.
//!
//! Strips and histograms have classes. Charts have colours as presentation attributes, which a stylesheet overrides.
//! The colours of curves are those of Okabe and Ito, darkened or lightened: distinct also with colour blindness.

/// Stylesheet of strips and histograms: light, or dark if the reader prefers it, except in print.
pub const STYLE: &str = concat!(
    ".pic text{font-family:system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif;font-size:12px;fill:#3c444d}",
    ".pic .t{font-weight:600;fill:#15191e}.pic .e{text-anchor:end}.pic .m{text-anchor:middle}",
    ".pic .bg{fill:#fff}.pic .g{fill:none;stroke:#e4e7eb}.pic .z{fill:none;stroke:#b4bbc3}.pic .x{fill:none;stroke:#c8cdd3}",
    ".pic .v{fill:none;stroke:#b3261e;stroke-dasharray:4 3}.pic .vt{fill:#b3261e;font-weight:600}",
    ".pic .l{fill:none;stroke-width:1.3;stroke-linejoin:round}.pic .a{stroke:none;fill-opacity:.28}",
    ".pic .l.c0{stroke:#0067a5}.pic .l.c1{stroke:#c24e00}.pic .l.c2{stroke:#00805c}.pic .l.c3{stroke:#a1428d}",
    ".pic .l.c4{stroke:#8a6d00}.pic .l.c5{stroke:#3f8fc4}.pic .l.c6{stroke:#30343a}.pic .l.c7{stroke:#7a4a2a}",
    ".pic .a.c0{fill:#0067a5}.pic .a.c1{fill:#c24e00}.pic .a.c2{fill:#00805c}.pic .a.c3{fill:#a1428d}",
    ".pic .a.c4{fill:#8a6d00}.pic .a.c5{fill:#3f8fc4}.pic .a.c6{fill:#30343a}.pic .a.c7{fill:#7a4a2a}",
    ".pic .s{fill-opacity:1}",
    ".pic .b0{fill:#d5d9de}.pic .b1{fill:#a9cbe6}.pic .b2{fill:#56a0d3}.pic .b3{fill:#0b5c94}",
    ".pic .b4{fill:#f2cf63}.pic .b5{fill:#e08b3e}.pic .b6{fill:#a93226}",
    ".pic .bt{fill:#15191e}.pic .bt.b3,.pic .bt.b6{fill:#fff}.pic .bt{font-size:11px}",
    "@media screen and (prefers-color-scheme:dark){",
    ".pic text{fill:#c3cad2}.pic .t{fill:#eef1f4}.pic .bg{fill:#171b20}.pic .g{stroke:#2b3138}.pic .z{stroke:#5b646e}.pic .x{stroke:#434b54}",
    ".pic .v{stroke:#ff8a80}.pic .vt{fill:#ff8a80}",
    ".pic .l.c0{stroke:#5db3ec}.pic .l.c1{stroke:#ff9a55}.pic .l.c2{stroke:#3fc79a}.pic .l.c3{stroke:#e08fcd}",
    ".pic .l.c4{stroke:#e3c34a}.pic .l.c5{stroke:#9fd4f7}.pic .l.c6{stroke:#e4e7eb}.pic .l.c7{stroke:#c99a78}",
    ".pic .a.c0{fill:#5db3ec}.pic .a.c1{fill:#ff9a55}.pic .a.c2{fill:#3fc79a}.pic .a.c3{fill:#e08fcd}",
    ".pic .a.c4{fill:#e3c34a}.pic .a.c5{fill:#9fd4f7}.pic .a.c6{fill:#e4e7eb}.pic .a.c7{fill:#c99a78}",
    ".pic .b0{fill:#4a525b}.pic .bt.b0{fill:#eef1f4}.pic .bt{fill:#15191e}.pic .bt.b3,.pic .bt.b6{fill:#fff}",
    "}",
);

/// Stylesheet of charts: other colours if the reader prefers a dark theme.
const CHARTS: &str = concat!(
    "@media screen and (prefers-color-scheme:dark){",
    "svg [fill='#FFFFFF']{fill:#171b20}svg [stroke='#FFFFFF']{stroke:#2b3138}",
    "svg [fill='#000000']{fill:#c3cad2}svg [stroke='#000000']{stroke:#7d8792}",
    "svg [fill='#1663A8']{fill:#5db3ec}svg [stroke='#1663A8']{stroke:#5db3ec}",
    "svg [fill='#C04A12']{fill:#ff9a55}svg [stroke='#C04A12']{stroke:#ff9a55}",
    "svg [fill='#2A8A4A']{fill:#3fc79a}svg [stroke='#2A8A4A']{stroke:#3fc79a}",
    "svg [fill='#7A3D9C']{fill:#c79be8}svg [stroke='#7A3D9C']{stroke:#c79be8}",
    "svg [fill='#222222']{fill:#e4e7eb}svg [stroke='#222222']{stroke:#e4e7eb}",
    "svg [fill='#A88410']{fill:#e3c34a}svg [stroke='#A88410']{stroke:#e3c34a}",
    "}",
);

/// Number of colours for curves.
pub(crate) const COLOURS: usize = 8;

/// Adds the stylesheet to a picture, for a separate file. Text that is not a picture is returned unchanged.
pub fn standalone(svg: &str) -> String {
    match svg.find('>') {
        Some(end) if svg.starts_with("<svg") => {
            let (tag, rest) = svg.split_at(end + 1);
            let style = if tag.contains("class=\"pic\"") { STYLE } else { CHARTS };
            format!("{tag}<style>{style}</style>{}\n", rest.trim_end())
        }
        _ => svg.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{Ink, Panel, Series, plain};

    #[test]
    fn every_colour_of_a_chart_has_one_for_the_dark() {
        let series = (0..6).map(|_| Series::new("one", Ink::Marks, [[0.0, 1.0]]));
        let chart = plain(&[Panel::new("all", ["x", "y"], series)], 1).unwrap();
        let mut colours: Vec<&str> = ["fill=\"#", "stroke=\"#"]
            .iter()
            .flat_map(|key| chart.split(key).skip(1).map(|rest| &rest[..6]))
            .collect();
        colours.sort_unstable();
        colours.dedup();
        assert!(colours.len() >= 8, "{colours:?}");
        for colour in colours {
            assert!(CHARTS.contains(&format!("[fill='#{colour}']")), "{colour}");
        }
    }

    #[test]
    fn picture_of_its_own_has_one_stylesheet() {
        let text = standalone("<svg class=\"pic\"><path/></svg>");
        assert!(text.starts_with("<svg class=\"pic\"><style>.pic"), "{text}");
        assert_eq!(text.matches("<style>").count(), 1);
        assert_eq!(standalone("no picture"), "no picture");
    }
}
