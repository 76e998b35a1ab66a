#!/usr/bin/env bash
# check.sh: static checks of the sources. Warnings are errors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# The rack stands without the bench; the simulation knows nothing of what it judges.
cargo metadata --locked --no-deps --format-version 1 | python3 -B scripts/rooms.py
scripts/lines.sh --check
scripts/drive_eds.py --check
cargo fmt --all -- --check
cargo fmt --manifest-path lab/Cargo.toml -- --check
cargo fmt --manifest-path link/Cargo.toml -- --check # clippy: scripts/test.sh, with the build
cargo clippy --workspace --all-targets --locked -- -D warnings
cargo clippy --workspace --test vcan --test vcan_faults --test network --locked -- -D warnings
cargo clippy --no-default-features --locked -- -D warnings
cargo clippy --no-default-features --features demo --locked -- -D warnings
cargo clippy --manifest-path lab/Cargo.toml --target-dir target --all-targets --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --document-private-items
# The front page leads to the crates by paths that rustdoc does not check.
grep -o '(\.\./[a-z_]*/index\.html)' src/lib.rs | tr -d '()' | while read -r page; do
  [[ -f target/doc/frhc/$page ]] || { echo "check: src/lib.rs: no page $page" >&2; exit 1; }
done

# Links, anchors and citations of the book are tests: cargo test --test repository.
if command -v mdbook >/dev/null; then
  mdbook build
else
  echo "no mdbook here: the book is not built" >&2
fi
