//! Diagnostic procedures for tools beside a running bus.
//!
//! | machine             | purpose                                                  |
//! |---------------------|----------------------------------------------------------|
//! | [`scan`]            | nodes on the bus                                         |
//! | [`states`]          | NMT states of nodes without a heartbeat: node guarding   |
//! | [`silent`]          | NMT states of nodes that respond to no SDO request       |
//! | [`effective`]       | configured PDOs of a node                                |
//! | [`confirm`]         | NMT command with its confirmation                        |
//! | [`network_monitor`] | boot-up, change of state and loss of nodes               |
//! | [`beats`]           | last heartbeat of each node                              |
//! | [`presence`]        | detection of a running master by its SYNC                |
//! | [`Procedure`](crate::procedure) | common interface                             |

pub mod beats;
pub mod confirm;
pub mod effective;
pub mod network_monitor;
pub mod presence;
pub mod scan;
pub mod silent;
pub mod states;
