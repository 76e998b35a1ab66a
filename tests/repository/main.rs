//! Checks of documents against the sources: the plan of the rooms, the tests of every hazard, the book.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod architecture;
mod book;
mod claims;
mod clippy;
mod hazards;
mod keys;
mod lab;
mod link_page;
mod names;
mod pages;
mod rack_alone;
mod ranges;
mod scripts;
mod sessions;
