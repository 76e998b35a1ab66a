//! The `sh` blocks of README and docs/: each is in the table, and those that need no bus run.

use std::path::Path;

use crate::common::cli::folder;
use crate::common::documented::{Lane, ROWS, SESSION, run};
use crate::common::sh_blocks::blocks;

/// A new block gets a row in `tests/common/documented.rs`: the lane that runs it, or the reason why none does.
#[test]
fn every_sh_block_is_run_or_has_a_reason() {
    let blocks = blocks(Path::new("."));
    let row_of = |block| ROWS.iter().position(|row| row.is_of(block));
    for block in &blocks {
        assert!(
            row_of(block).is_some(),
            "{} has a block without a row: {:?}",
            block.page,
            block.lines
        );
    }
    for (number, row) in ROWS.iter().enumerate() {
        let own = blocks.iter().filter(|block| row_of(block) == Some(number)).count();
        assert_eq!(own, 1, "row {number}: blocks of {}", row.page);
    }
}

#[test]
fn sh_blocks_without_a_bus_run_as_written() {
    let folder = folder("program", "documented");
    let count = run(&folder, |lane| match lane {
        Lane::AnyMachine => Some(""),
        Lane::Session => Some(SESSION),
        Lane::Vcan(_) | Lane::Network(_) | Lane::NotRun(_) => None,
    });
    assert!(count > 5, "{count}");
}
