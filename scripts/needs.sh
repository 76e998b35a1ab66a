# needs.sh: sourced by scripts that need more than a Rust toolchain.

# needs NAME OPTIONAL PARTS [ITEM...]: returns if neither an item nor a part of setup.sh is missing. Else says what is, for the
# script NAME, and exits with 69, or 0 if OPTIONAL is not empty.
needs() {
  local name=$1 optional=$2 parts=$3 packages
  shift 3
  # shellcheck disable=SC2086 # words
  mapfile -t packages < <(scripts/setup.sh --missing $parts || true)
  local missing=("$@" "${packages[@]}")
  ((${#missing[@]})) || return 0
  echo "$name: missing: $(printf '%s, ' "${missing[@]}" | sed 's/, $//') (scripts/setup.sh $parts)" >&2
  [[ -n $optional ]] && exit 0
  exit 69
}
