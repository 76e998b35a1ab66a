//! Report of a recorded session or a fault record: one self-contained page without a script.
//!
//! ```text
//!  folder ──► Subject ──► SessionData ──► View ──► sections ──► one HTML file
//!             what there   one pass       with the
//!             is to read   of cycles      stops in words
//! ```
//!
//! Begin with `subject.rs`, then `gather.rs`, the one pass, and `sections`, a file for each question.
//!
//! A part that cannot be read is named in the report; the rest is shown.
#![forbid(unsafe_code)]

mod compare;
mod figures;
#[cfg(test)]
mod fixture;
mod frames;
mod gather;
mod html;
mod modes;
mod page;
mod replayed;
mod sections;
mod series;
mod stops;
mod subject;
mod timing;
mod view;
mod words;

pub use page::{Interruption, Page, report};
pub use subject::{NoSubject, Subject};
