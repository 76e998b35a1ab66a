//! Gain check: which gains are stable in every hand, and what passivity alone says of them.
//!
//! Not what watches the energy at run time. Linear, one axis at a time:
//!
//! | file               | what                                                                     |
//! |--------------------|--------------------------------------------------------------------------|
//! | [`gate`]           | stability of each loop in every hand, at every posture of a sample       |
//! | [`sampled_loop`]   | characteristic polynomial of one axis, with all delays                   |
//! | [`grip_dynamics`]  | the grip reduced to one axis at the frequency of a swing                 |
//! | [`polynomial`]     | polynomials in the delay operator, Jury's table                          |
//! | `least_multiple`   | largest multiple of a gain that is stable                                |
//! | [`passivity`]      | damping that a sampled law asks for (Colgate and Schenkel 1997)          |
//! | [`bounds`]         | closed forms: quantisation, centring, rate mode, accommodation, dampers  |
//! | [`device`]         | mass, damping and friction at the grip, at the start                     |
//! | [`axis`]           | passivity and closed forms of one axis                                   |
//! | `contact`          | those that contact closes                                                |
//! | [`push`]           | force with which torques push a hand                                     |
//! | [`finding`]        | an inequality in words and numbers                                       |
//!
//! Gains that swing in some hand, or contradict each other, are refused: a loop whose spectral radius reaches 1, an
//! object that swings on a surface by itself, a return to centre that friction stops. Gains that only cost strict
//! passivity, or that swing when the grip is let go, are a warning: the hand's own damping then keeps the loop quiet, as
//! all hand controllers of this kind rely on, and a passivity layer where there is one.

pub mod axis;
pub mod bounds;
mod contact;
pub mod device;
pub mod finding;
pub mod gate;
pub mod grip_dynamics;
mod least_multiple;
pub mod passivity;
pub mod polynomial;
pub mod push;
pub mod sampled_loop;
