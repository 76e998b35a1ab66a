//! Dual peg: the experiment of Table I (Williams 1997, 4.3) on simulated operators, hand controller and robot.
//!
//! | file             | part                                                    |
//! |------------------|---------------------------------------------------------|
//! | [`settings`]     | the checked settings; `settings_file` has the raw keys  |
//! | [`condition`]    | the two switches: reflection and accommodation          |
//! | `bench`          | hand controller, robot, pegs and plate of one trial     |
//! | [`peg_operator`] | task of an operator who puts pegs into holes by sight   |
//! | [`trial`]        | one trial and its figures                               |
//! | [`contact_work`] | work of the contact wrench, Eq. 11                      |
//! | [`statistics`]   | statistics of all trials of an operator in a condition  |

pub mod bench;
pub mod condition;
pub mod contact_work;
pub mod peg_operator;
pub mod settings;
mod settings_file;
pub mod statistics;
pub mod trial;
