#!/usr/bin/env bash
# check.sh: what can be said of the sources without running them. Warnings are errors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# never PACKAGE STRANGER... [-- OPTION...]: what the package is built from has none of the strangers in it.
never() {
  local package=$1 strangers=() name tree
  shift
  while (($#)) && [[ $1 != -- ]]; do strangers+=("$1"); shift; done
  shift || true
  tree=$(cargo tree --locked --edges normal --prefix none --package "$package" "$@" | awk '{print $1}' | sort -u)
  for name in "${strangers[@]}"; do
    if grep -qx "$name" <<<"$tree"; then
      echo "check: $package $* depends on $name" >&2
      return 1
    fi
  done
}
bench="frhc-sim frhc-lab frhc-canopen-tools"
# shellcheck disable=SC2086 # a word each
never frhc-run $bench frhc-sealed-link snow
# shellcheck disable=SC2086
never frhc $bench frhc-sealed-link snow -- --no-default-features
never frhc-sim frhc-controller frhc-robot frhc-remote

cargo fmt --all -- --check
cargo clippy --workspace --all-targets --locked -- -D warnings
cargo clippy --test vcan --test vcan_faults --locked -- -D warnings
cargo clippy --no-default-features --locked -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --document-private-items
