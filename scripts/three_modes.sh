#!/usr/bin/env bash
# three_modes.sh [OPTION...]: one scenario in the three modes of the paper (section 4), in virtual time: a virtual object, a robot
# behind the link, and that robot with a model of it. Three configurations, in target/three_modes, differ in the key remote.kind
# alone. Prints for each what was sensed and felt. Options are those of `frhc demo`: --scenario NAME, --seconds S, --seed N, --out FOLDER.
#
# Runs from a fresh clone: builds frhc unless $FRHC names it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ -z ${FRHC:-} ]]; then
  cargo build --locked --profile dist --features png
  FRHC=$PWD/target/dist/frhc
fi
folder=target/three_modes
mkdir -p $folder
link='[remote.link]
round_trip_ms = 5.0
stiffest_contact_n_per_m = 2000.0
model_limit_m = 0.02
model_limit_deg = 5.0
'
for kind in virtual link both; do
  file=$folder/$kind.toml
  sed -e "s|\"../eds/|\"$PWD/eds/|" -e "s/^kind = \"virtual\"/kind = \"$kind\"/" \
    -e "s|^start_m = .*|robot = \"$PWD/config/robots/puma560.toml\"|" -e '/^start_deg = \[90/d' \
    -e "s/^\[remote.wall\]/${link//$'\n'/\\n}\n[remote.wall]/" config/kraft_like.toml >$file
  echo "--- remote.kind = \"$kind\" ($file)"
  "$FRHC" -q demo --config $file "$@"
done
