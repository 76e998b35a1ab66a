//! PNG of a picture: its SVG in light colours, rendered with the same font on every machine.

use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

use crate::theme;

/// Pixels of the PNG for each px of the picture: sharp on screens and on slides.
const SCALE: f32 = 2.0;

/// Family of the font.
const FAMILY: &str = "DejaVu Sans";

/// Reason why a picture cannot be rendered.
#[derive(Debug)]
pub struct RasterError(String);

impl std::fmt::Display for RasterError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "cannot render the picture: {}", self.0)
    }
}

impl std::error::Error for RasterError {}

/// Renders a picture as PNG, with two pixels for each px.
///
/// # Errors
/// Returns an error if the picture is not SVG, or is too large.
pub fn png(svg: &str) -> Result<Vec<u8>, RasterError> {
    let svg = if svg.contains("<style>") { svg.to_owned() } else { theme::standalone(svg) };
    let svg = light(&svg);
    let mut fonts = Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family(FAMILY);
    let options =
        Options { fontdb: Arc::new(fonts), font_family: FAMILY.to_owned(), ..Options::default() };
    let tree = Tree::from_str(&svg, &options).map_err(|error| RasterError(error.to_string()))?;
    let size = tree.size().to_int_size().scale_by(SCALE);
    let pixmap = size.and_then(|size| Pixmap::new(size.width(), size.height()));
    let mut pixmap = pixmap.ok_or_else(|| RasterError("it is too large".to_owned()))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|error| RasterError(error.to_string()))
}

/// Removes the colours of the dark theme, which the PNG renderer does not support, from the end of a stylesheet.
fn light(svg: &str) -> String {
    match (svg.find("@media"), svg.find("</style>")) {
        (Some(begin), Some(end)) if begin < end => {
            [svg.get(..begin), svg.get(end..)].into_iter().flatten().collect()
        }
        _ => svg.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strip::{Curve, Extent, Plot, Strip};

    #[test]
    fn png_has_the_size_of_the_picture_twice_and_its_text() {
        let mut strip = Strip::new("one", 0.0..1.0);
        let curve = Curve::new("one", [Extent { from: 0.0, to: 1.0, min: -1.0, max: 1.0 }]);
        strip.plots.push(Plot::new("one", "N", [curve]));
        let svg = strip.svg(300.0);
        let drawn = png(&svg).unwrap();
        assert_eq!(drawn[..8], *b"\x89PNG\r\n\x1a\n");
        assert_eq!(drawn[16..20], 600_u32.to_be_bytes());
        let without = svg.replace(">one in N<", "><");
        assert_ne!(svg, without);
        assert_ne!(drawn, png(&without).unwrap(), "the text is not drawn");
        assert_eq!(drawn, png(&svg).unwrap());
    }

    #[test]
    fn text_that_is_no_picture_is_refused() {
        assert!(png("<html>").unwrap_err().to_string().starts_with("cannot render"));
    }

    #[test]
    fn colours_of_the_dark_theme_are_removed() {
        let text = light(&theme::standalone("<svg class=\"pic\"><path/></svg>"));
        assert!(!text.contains("@media") && text.contains("</style><path/>"), "{text}");
    }
}
