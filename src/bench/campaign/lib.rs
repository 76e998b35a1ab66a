//! Campaigns: thousands of faults on the in-memory bus in virtual time, each alone, judged by a monitor on the bus.
//!
//! The cases of a campaign are numbered from 1. Seed and number alone say what a case is: fault, hand controller,
//! situation, microsecond. So a case can be replayed by itself, and the number of threads changes nothing.
//!
//! | file          | what                                                              |
//! |---------------|-------------------------------------------------------------------|
//! | `case`        | one case of a seed                                                |
//! | `catalogue`   | every kind of fault, its hazard and its criterion                 |
//! | `criterion`   | the acceptance criterion of a case                                |
//! | `expectation` | one row for each hazard: limit, causes, end state of the drives   |
//! | `injection`   | faults and actions of a case, and what they demand                |
//! | `kind`        | one kind of fault: hazard, situations, causes that may stop       |
//! | `monitor`     | the judge: invariants I1 to I13                                   |
//! | `observer`    | measurements of a case after every cycle                          |
//! | `play`        | one case from its onset to its end                                |
//! | `random`      | random joints, durations, bytes                                   |
//! | `rpdo_loss`   | torque that a drive without its RPDOs holds                       |
//! | `run`         | all cases, on every core                                          |
//! | `situation`   | armed, free motion, in contact                                    |
//! | `soak`        | long runs in which nothing may stop                               |
//! | `stage`       | a bench booted and brought into a situation                       |
//! | `table`       | the figures by kind                                               |
//! | `timers`      | times within which the drives stop by themselves                  |
//! | `verdict`     | the outcome of a case                                             |
//! | `verification` | cases replayed from the recorded inputs of their nodes           |
#![forbid(unsafe_code)]

pub mod case;
pub mod catalogue;
pub mod criterion;
pub mod expectation;
pub mod injection;
pub mod kind;
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
pub mod timers;
pub mod verdict;
pub mod verification;
