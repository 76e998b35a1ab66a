//! Documents against the sources: the rooms of ARCHITECTURE.md, and the tests of every hazard.

mod architecture;
mod claims;
mod hazards;
