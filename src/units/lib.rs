//! Units common to all crates: time, joints and nodes, drive units, and spatial vectors.
//!
//! Positions of drives are in counts, times in microseconds. Twists and wrenches have named parts instead of six-vectors.
//! STYLE.md has the notation of frames.
//!
//! ```
//! use nalgebra::Isometry3;
//! use units::spatial::Wrench;
//! use units::time::Instant;
//!
//! // 2 N along x, half a metre up: a moment of 1 N·m about y at the origin.
//! let f_g = Wrench::from_components([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
//! let f_0 = f_g.at(&Isometry3::translation(0.0, 0.0, 0.5));
//! assert_eq!(f_0.moment.y, 1.0);
//!
//! let sync = Instant::from_micros(1_000);
//! assert_eq!((sync + std::time::Duration::from_millis(1)).since(sync).as_millis(), 1);
//! ```
#![forbid(unsafe_code)]

pub mod adjustment;
pub mod drive;
pub mod math;
pub mod numbering;
pub mod spatial;
pub mod time;
pub mod wording;
