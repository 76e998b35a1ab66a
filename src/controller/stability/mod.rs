//! Gain check: stability of the gains in every modelled hand, and their passivity.
//!
//! The models are linear, one axis at a time. At run time [`passivity`](crate::passivity) observes the energy.
//!
//! | file              | what                                                                    |
//! |-------------------|-------------------------------------------------------------------------|
//! | [`gate`]          | stability of each loop in every hand, at every posture of a sample      |
//! | [`sampled_loop`]  | characteristic polynomial of one axis, with all delays                  |
//! | [`grip_dynamics`] | the grip reduced to one axis at the frequency of a swing                |
//! | [`polynomial`]    | polynomials in the delay operator, Jury's table                         |
//! | `gain_margin`     | largest multiple of a gain that is stable                               |
//! | [`mod@passivity`] | damping that a sampled law requires (Colgate and Schenkel 1997)         |
//! | [`bounds`]        | closed forms: quantisation, centring, rate mode, accommodation, dampers |
//! | [`device`]        | mass, damping and friction at the grip, at the start                    |
//! | [`axis`]          | passivity and closed forms of one axis                                  |
//! | `contact`         | the loops of one axis that contact closes                               |
//! | [`push`]          | force with which torques push a hand                                    |
//! | [`finding`]       | an inequality in words and numbers                                      |
//!
//! The check refuses a loop with a spectral radius of 1 or more in some hand. It also refuses an object that oscillates on
//! a surface, and a return to centre that friction stops. It warns of gains that are not passive, or that oscillate when
//! the grip is let go. The damping of the hand then stabilises the loop, as in all hand controllers of this kind, and so
//! does a passivity layer, if configured.

pub mod axis;
pub mod bounds;
mod contact;
pub mod device;
pub mod finding;
mod gain_margin;
pub mod gate;
pub mod grip_dynamics;
pub mod passivity;
pub mod polynomial;
pub mod push;
pub mod sampled_loop;
