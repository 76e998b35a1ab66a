//! Threads of a run: names, and small stacks, because all memory is locked.

use std::thread::Builder;

/// Stack of a thread, in bytes. The default is eight times as large.
const STACK: usize = 256 * 1_024;

/// Stack of the cycle's thread, in bytes. The node is moved onto it.
const CYCLE_STACK: usize = 512 * 1_024;

/// Returns the builder of the thread `frhc-NAME`; `name` has at most 10 bytes.
pub(super) fn builder(name: &str) -> Builder {
    let stack = if name == "cycle" { CYCLE_STACK } else { STACK };
    Builder::new().name(format!("frhc-{name}")).stack_size(stack)
}
