//! Campaigns: thousands of faults on the in-memory bus in virtual time, each alone, judged by a monitor on the bus.
//!
//! The cases of a campaign are numbered from 1. Seed and number determine a case: fault, hand controller, situation, onset.
//! A case can therefore be replayed alone, and the number of threads does not change the verdicts.
//! Begin with `play`, one case from its onset to its end.
//!
//! | file           | content                                                          |
//! |----------------|------------------------------------------------------------------|
//! | `case`         | one case of a seed                                               |
//! | `catalogue`    | every kind of fault, its hazard and its criterion                |
//! | `criterion`    | the acceptance criterion of a case                               |
//! | `expectation`  | one row for each hazard: limit, causes, end state of the drives  |
//! | `injection`    | faults and actions of a case, with the required reaction         |
//! | `kind`         | one kind of fault: hazard, situations, causes that may stop      |
//! | `lost_zeros`   | arms whose drives lose their zero, beside their rest posture     |
//! | `monitor`      | invariants I1 to I13, checked on the bus                         |
//! | `observer`     | measurements of a case after every cycle                         |
//! | `play`         | one case from its onset to its end                               |
//! | `random`       | random joints, durations, bytes                                  |
//! | `rpdo_loss`    | torque that a drive without its RPDOs holds                      |
//! | `run`          | all cases, on every core                                         |
//! | `situation`    | ready, armed, zeros set, parking, free motion, in contact        |
//! | `soak`         | long runs with lost samples and without a fault                  |
//! | `stage`        | a bench, booted and brought into a situation                     |
//! | `table`        | the figures by kind, as text                                     |
//! | `tally`        | the figures in progress                                          |
//! | `timers`       | times until drives stop without their master                     |
//! | `verdict`      | the outcome of a case                                            |
//! | `verification` | cases replayed from the recorded inputs of their nodes           |
#![forbid(unsafe_code)]

pub mod case;
pub mod catalogue;
pub mod criterion;
pub mod expectation;
pub mod injection;
pub mod kind;
pub mod lost_zeros;
pub mod monitor;
mod observer;
pub mod play;
mod random;
mod rpdo_loss;
pub mod run;
pub mod situation;
pub mod soak;
pub mod stage;
pub mod table;
pub mod tally;
pub mod timers;
pub mod verdict;
pub mod verification;
