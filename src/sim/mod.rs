//! What does not exist: the drives and the switch box of a hand controller, as stations on a bus.
//!
//! Written without a look at `controller` and `robot`, so that no mistake cancels itself out.

pub mod actuator;
pub mod drive;
pub mod power;
pub mod switches;
