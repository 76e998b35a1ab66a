//! One arena for all threads of `frhc run`.
//!
//! glibc gives each thread that allocates an arena, an address space of 64 MB, and `mlockall` counts all of it as locked: half a
//! gigabyte, of which a tenth is used. The number of arenas is read from the environment before `main`, so the process
//! begins once more with it. systemd's unit sets it at once.

use std::env;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Number of arenas, as glibc reads it.
const ARENAS: &str = "MALLOC_ARENA_MAX";

/// Begins the program once more with one arena, unless their number is given. Returns where that is not possible: the node then runs
/// with more locked memory.
pub fn begin() {
    if env::var_os(ARENAS).is_some() {
        return;
    }
    let Ok(program) = env::current_exe() else { return };
    let mut args = env::args_os();
    let name = args.next().unwrap_or_default();
    // It returns only if it was refused.
    drop(Command::new(program).arg0(name).args(args).env(ARENAS, "1").exec());
}
