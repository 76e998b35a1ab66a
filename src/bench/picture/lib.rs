//! Pictures: charts of experiments, histograms, and time series of sessions with extremes, modes and events. Pictures are
//! SVG, or PNG rendered from it (feature `png`).
//!
//! ```
//! use picture::strip::{Curve, Extent, Plot, Strip};
//!
//! let felt = (0..5).map(f64::from).map(|at| Extent { from: at, to: at + 1.0, min: -at, max: at });
//! let mut strip = Strip::new("Force felt", 0.0..5.0);
//! strip.plots.push(Plot::new("force", "N", [Curve::new("fx", felt)]));
//! let svg = picture::standalone(&strip.svg(900.0));
//! assert!(svg.starts_with("<svg"));
//! ```
#![forbid(unsafe_code)]

mod axis;
mod chart;
mod curve;
pub mod histogram;
mod ink;
mod legend;
#[cfg(feature = "png")]
mod raster;
pub mod strip;
mod theme;
mod trace;

pub use chart::{Ink, Panel, Series, svg};
pub use ink::escaped;
#[cfg(feature = "png")]
pub use raster::{RasterError, png};
pub use theme::{STYLE, standalone};
