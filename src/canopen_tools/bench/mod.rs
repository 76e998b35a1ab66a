//! What a bench asks of a network: machines that come to an end, for tools beside a running bus.
//!
//! | machine       | what it finds out or does                                       |
//! |---------------|------------------------------------------------------------------|
//! | [`scan`]      | who is there                                                     |
//! | [`effective`] | which PDOs a node really has                                     |
//! | [`confirm`]   | an NMT command, and who is heard to have obeyed it               |
//! | [`watch`]     | who comes, changes its state, falls silent                       |
//! | [`presence`]  | whether a master runs here: SYNC                                  |
//! | [`Procedure`](canopen::procedure) | what they have in common                     |

pub mod confirm;
pub mod effective;
pub mod presence;
pub mod scan;
pub mod watch;
