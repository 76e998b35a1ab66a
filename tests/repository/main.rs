//! Checks of documents against the sources: the plan of the rooms, the tests of every hazard, the book.

mod architecture;
mod book;
mod citations;
mod claims;
mod clippy;
mod hazards;
mod keys;
mod link_page;
mod pages;
mod rack_alone;
mod ranges;
mod scripts;
mod sessions;
mod steps;
