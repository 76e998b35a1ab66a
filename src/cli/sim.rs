//! `frhc sim`: simulated drives, switch box, arm and operator on SocketCAN.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
