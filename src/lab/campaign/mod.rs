//! Many faults, each alone, on the in-memory bus in virtual time; a judge on the bus says what came of each.
//!
//! A campaign is a seed. Its cases are numbered from 1, and the number and the seed alone say what a case is:
//! which fault, on which hand controller, in which situation, at which microsecond. So one case can be played
//! again by itself, and nothing depends on how many threads there are.
//!
//! | file        | what                                                           |
//! |-------------|----------------------------------------------------------------|
//! | `case`      | what a number of a seed means                                  |
//! | `catalogue` | every kind of fault, its hazard row, and what is expected      |
//! | `draw`      | chance: joints, spans, bytes                                   |
//! | `injection` | what is done to buses, drives and people, and what must follow |
//! | `kind`      | one kind of fault: hazard, situations, causes that may stop    |
//! | `situation` | armed alone, free motion, in contact                           |
//! | `monitor`   | the judge: invariants I1 to I12                                |
//! | `play`      | one case from its onset to its end                             |
//! | `verdict`   | what it came to, and whether that is what is expected          |
//! | `run`       | all of them, on every core                                     |
//! | `table`     | the figures by kind                                            |
//! | `soak`      | long runs in which nothing may trip                            |

pub mod case;
pub mod catalogue;
mod draw;
pub mod injection;
pub mod kind;
pub mod monitor;
pub mod play;
pub mod run;
pub mod situation;
pub mod soak;
pub mod table;
pub mod verdict;
