#!/usr/bin/env bash
# check.sh: static checks of the sources. Warnings are errors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# must_not_depend PACKAGE FORBIDDEN... [-- OPTION...]: fails if the package depends on a forbidden one.
must_not_depend() {
local package=$1 forbidden=() name tree
  shift
  while (($#)) && [[ $1 != -- ]]; do forbidden+=("$1"); shift; done
  shift || true
  tree=$(cargo tree --locked --edges normal --prefix none --package "$package" "$@" | awk '{print $1}' | sort -u)
  for name in "${forbidden[@]}"; do
    if grep -qx "$name" <<<"$tree"; then
      echo "check: $package $* depends on $name" >&2
      return 1
    fi
  done
}
bench="frhc-sim frhc-lab frhc-canopen-tools"
# shellcheck disable=SC2086 # a word each
must_not_depend frhc-run $bench frhc-sealed-link snow
# shellcheck disable=SC2086
must_not_depend frhc $bench frhc-sealed-link snow -- --no-default-features
must_not_depend frhc-sim frhc-controller frhc-robot frhc-remote

scripts/prose.sh
scripts/drive_eds.py --check
cargo fmt --all -- --check
cargo clippy --workspace --all-targets --locked -- -D warnings
cargo clippy --test vcan --test vcan_faults --locked -- -D warnings
cargo clippy --no-default-features --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --document-private-items

# Links, anchors and citations of the book are tests: cargo test --test repository.
if command -v mdbook >/dev/null; then
  mdbook build
else
  echo "no mdbook here: the book is not built" >&2
fi
