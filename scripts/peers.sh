#!/usr/bin/env bash
# peers.sh: what a cycle costs and how late its torques are, for `frhc run` and for other masters of the same exchange.
#
# usage: scripts/peers.sh [--lely TREE] [--optional]
#
# All of them drive the same simulated drives, one after the other in one boot of the emulated machine (with_icount.sh), with
# SCHED_FIFO 80: once above the drives' 70, so that each sample ends a wait as on a wire, and once equal to theirs, so that the
# samples of a cycle come in a batch. A recorded run beside candump proves that they exchange the same frames, and shows the times;
# a run alone is timed. `frhc run` is as shipped, all threads and watches on. docs/performance.md says what the others do not do.
#
#   C loop           scripts/peers/loop.c
#   python-canopen   scripts/peers/python_canopen.py, where scripts/setup.sh tools has installed it
#   lely             scripts/peers/lely.cpp with lely-core 2.x of the source tree TREE. A copy of it is built in target/peers/lely
#                    (-O2, no assertions); TREE is not changed. Without --lely its row says "not measured".
#
# Without a tool or a tree it says what is missing and exits with 69, or 0 with --optional.
set -euo pipefail
started_in=$PWD
cd "$(dirname "${BASH_SOURCE[0]}")/.."
usage() {
  sed -n '2,/^set/{/^set/d;s/^# \?//p}' "$0" >&2
  exit 2
}
optional="" tree=""
while (($#)); do
  case $1 in
    --optional) optional=1; shift ;;
    --lely) [[ -n ${2-} ]] || usage; tree=$2; shift 2 ;;
    *) usage ;;
  esac
done
# fail MESSAGE: as needs.sh ends.
fail() {
  echo "peers: $1" >&2
  [[ -z $optional ]] || exit 0
  exit 69
}
. scripts/needs.sh
missing=()
[[ -x target/dist/frhc ]] || missing+=("target/dist/frhc (cargo build --profile dist)")
command -v gcc >/dev/null || missing+=(gcc)
command -v candump >/dev/null || missing+=(can-utils)

home=$PWD/target/peers/lely
[[ -z $tree ]] || tree=$(cd "$started_in" && realpath -m -- "$tree")
[[ $tree/ != "$home"/* ]] || fail "--lely: TREE must be outside target/peers/lely, which is built anew"
# A binary of an earlier run must not be measured.
rm -rf "$home"
if [[ -n $tree ]]; then
  lacking=()
  grep -qs '^AC_INIT(.*\[2\.[0-9.]*\].*\[lely-core\]' "$tree/configure.ac" || lacking+=("configure.ac of lely-core 2.x in $tree")
  tools=()
  for pair in autoreconf:autoconf automake:automake libtoolize:libtool make:make g++:g++; do
    command -v "${pair%%:*}" >/dev/null || tools+=("${pair##*:}")
  done
  remedy=${tools[*]:+" (scripts/apt.sh install ${tools[*]})"}
  lacking+=("${tools[@]}")
  ((${#lacking[@]} == 0)) || fail "--lely: missing: $(printf '%s, ' "${lacking[@]}" | sed 's/, $//')$remedy"
fi
needs peers "$optional" icount "${missing[@]}"

# build_lely: static libraries of a copy of $tree, and the peer. Its chain of && replaces set -e, which has no effect in a condition.
build_lely() {
  local archives=() name
  mkdir -p "$home/source" "$home/build" &&
    # A tree that has been configured in place has objects that make would find.
    tar -C "$tree" -c --exclude=.git --exclude=.libs --exclude='*.[ao]' --exclude='*.l[ao]' --exclude=config.status . |
    tar -C "$home/source" -x &&
    (cd "$home/source" && autoreconf -i) &&
    (cd "$home/build" && ../source/configure --disable-shared --disable-python --disable-cython --disable-tests \
      --disable-unit-tests --disable-tools --disable-doc CPPFLAGS=-DNDEBUG) &&
    # lely's own flags have -Werror, and a newer compiler has newer warnings.
    make -C "$home/build/src" -j"$(nproc)" CFLAGS="-O2 -pthread" CXXFLAGS="-O2 -pthread" || return
  # The additions to the C library are "libc" or "compat", by version. "io" and "io2" define the same names; coapp uses io2.
  for name in coapp co io2 ev can util libc compat; do
    [[ ! -e $home/build/src/$name/.libs/liblely-$name.a ]] || archives+=("$home/build/src/$name/.libs/liblely-$name.a")
  done
  g++ -std=c++14 -O2 -DNDEBUG -Wall -Wextra -pthread -isystem "$home/source/include" -o "$home/lely" scripts/peers/lely.cpp \
    -Wl,--start-group "${archives[@]}" -Wl,--end-group -lrt
}
if [[ -n $tree ]]; then
  echo "peers: building lely" >&2
  mkdir -p "$home"
  if ! build_lely >"$home/log" 2>&1; then
    tail -n 20 "$home/log" >&2
    rm -f "$home/lely"
    fail "--lely: $tree does not build (target/peers/lely/log)"
  fi
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p target/peers
gcc -O2 -Wall -Wextra -o target/peers/loop scripts/peers/loop.c
measured() { # LAYOUT PERIOD_US CONFIG PRIORITY HOW
  echo "peers: $1, $2 µs, $5" >&2
  scripts/with_icount.sh -t 500 -- scripts/peers/in_machine.sh "${@:1:4}" >"$work/$1"
  printf '\n%s, %s µs (%s), %s\n\n' "$1" "$2" "$3" "$5"
  scripts/peers/figures.py "$2" "$work/$1"
}
for how in "70 frame by frame" "80 in batches"; do
  measured grouped 1000 config/kraft_like.toml "${how%% *}" "${how#* }"
  measured per-drive 2000 config/kraft_like_500hz.toml "${how%% *}" "${how#* }"
done
