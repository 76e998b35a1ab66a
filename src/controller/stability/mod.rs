//! Gain check: the bounds of sampled force reflection, with both sides of every inequality.
//!
//! Not what watches the energy at run time. Linear, one axis at a time, at one posture:
//!
//! | file           | what                                                                     |
//! |----------------|--------------------------------------------------------------------------|
//! | [`passivity`]  | damping that a sampled law asks for (Colgate and Schenkel 1997)          |
//! | [`bounds`]     | closed forms: quantisation, centring, rate mode, accommodation, dampers  |
//! | [`device`]     | mass, damping and friction at the grip                                   |
//! | [`axis`]       | all inequalities of one axis, judged                                     |
//! | `contact`      | those that contact closes                                                |
//! | `late`         | reflection in rate mode over a link with delay                           |
//! | [`push`]       | force with which torques push a hand                                     |
//! | [`finding`]    | an inequality in words and numbers                                       |
//!
//! Gains that are unstable with any hand, or contradict each other, are refused: an object that swings on
//! a surface by itself, a return to centre that friction stops, a rate reflected that swings in the
//! operator's hand, a law that needs more damping than device, law and hand have together. Gains that only
//! cost strict passivity are a warning: the hand's own damping then keeps the loop quiet, as all hand
//! controllers of this kind rely on, and a passivity layer where there is one.

pub mod axis;
pub mod bounds;
mod contact;
pub mod device;
pub mod finding;
mod late;
pub mod passivity;
pub mod push;
