#!/usr/bin/env bash
# setup.sh: installs what the tests need beyond a Rust toolchain, on Debian and derivatives.
#
# usage: scripts/setup.sh [--missing] [tools|browser|kernel|icount]...  (default: tools, browser and kernel)
#
#   tools    can-utils, iproute2, jq, openssl, tmux, tshark, python3-venv from Debian (26 MB to fetch, 131 MB of disk, a minute; root
#            or sudo), and Python's packages, pinned in tests/interop/requirements.txt, from PyPI into target/interop
#            (600 MB of disk, a minute)
#   browser  what judges the pages that frhc writes: xmllint (libxml2-utils), and a headless browser with its driver for
#            tests/interop/browser.py. Chromium or Google Chrome is used where it is installed with a chromedriver of its version;
#            else chromium and chromium-driver from Debian (120 MB to fetch, 410 MB of disk, a minute; root or sudo). axe-core,
#            pinned by its checksum, which judges what a page is for those who do not see it, by npm into target/interop (0.7 MB)
#   kernel   a User-Mode Linux kernel that has vcan and virtual time, for $VCAN_KERNEL: one file of 7 MB in
#            ~/.cache/vcan-uml, built from Debian's kernel source (about 140 MB to fetch, some GB while it is built, about 8
#            minutes on two cores, once). It runs as an ordinary process; nothing of this machine's own kernel changes.
#   icount   what scripts/icount.sh counts instructions with: QEMU, busybox, cpio and valgrind from Debian (root or sudo), and
#            Debian's kernel package (70 MB, fetched at the first use, not installed)
#
# Each step prints what it installs, and waits while another apt holds a lock (scripts/apt.sh). --missing installs
# nothing: it lists what is missing, one per line, and exits with 1 if anything is.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

only_list=
parts=()
for word in "$@"; do
  case $word in
    --missing) only_list=1 ;;
    tools | browser | kernel | icount) parts+=("$word") ;;
    *) sed -n '2,/^set/s/^# \?//p' "$0" >&2; exit 2 ;;
  esac
done
((${#parts[@]})) || parts=(tools browser kernel)
wanted() { [[ " ${parts[*]} " == *" $1 "* ]]; }

kernel=${VCAN_KERNEL:-${VCAN_UML_HOME:-${XDG_CACHE_HOME:-$HOME/.cache}/vcan-uml}/linux-timetravel}
packages=()
command -v candump >/dev/null || packages+=(can-utils)
PATH=$PATH:/usr/sbin:/sbin command -v ip >/dev/null || packages+=(iproute2)
command -v jq >/dev/null || packages+=(jq)
command -v tshark >/dev/null || packages+=(tshark)
command -v openssl >/dev/null || packages+=(openssl)
command -v tmux >/dev/null || packages+=(tmux)
python3 -c 'import ensurepip, venv' 2>/dev/null || packages+=(python3 python3-venv)
venv=target/interop/venv
rig=()
for pair in qemu-system-x86_64:qemu-system-x86 busybox:busybox-static cpio:cpio valgrind:valgrind; do
  command -v "${pair%%:*}" >/dev/null || rig+=("${pair##*:}")
done
judges=()
command -v xmllint >/dev/null || judges+=(libxml2-utils)
python3 tests/interop/browser.py --which >/dev/null 2>&1 || judges+=(chromium chromium-driver)
# The name says the version, the checksum the content; tests/interop/view_access.py reads it.
axe=target/interop/axe-core-4.14.1.tgz
axe_sha256=e6b0ce02b84d892e2e33e403485e7f3d6c29e2be6df65daf44d89ba564139745
has_axe() { [[ -f $axe ]] && sha256sum --check --status <<<"$axe_sha256  $axe"; }
has_venv() { cmp -s tests/interop/requirements.txt target/interop/installed.txt && [[ -x $venv/bin/python ]]; }

if [[ -n $only_list ]]; then
  missing=()
  if wanted tools; then
    missing+=("${packages[@]}")
    has_venv || missing+=("$venv")
  fi
  if wanted browser; then missing+=("${judges[@]}"); fi
  if wanted kernel && [[ ! -x $kernel ]]; then missing+=("$kernel"); fi
  if wanted icount; then missing+=("${rig[@]}"); fi
  ((${#missing[@]} == 0)) || { printf '%s\n' "${missing[@]}"; exit 1; }
  exit
fi

if wanted tools && ((${#packages[@]})); then
  echo "setup: installing ${packages[*]} from Debian" >&2
  scripts/apt.sh install "${packages[@]}"
fi
if wanted tools && ! has_venv; then
  echo "setup: installing $(grep -v '^#' tests/interop/requirements.txt | paste -sd ' ') into $venv" >&2
  rm -rf "$venv" && mkdir -p target/interop
  python3 -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check -r tests/interop/requirements.txt
  cp tests/interop/requirements.txt target/interop/installed.txt
fi
if wanted browser && ((${#judges[@]})); then
  echo "setup: installing ${judges[*]} from Debian" >&2
  scripts/apt.sh install "${judges[@]}"
fi
if wanted browser && ! has_axe; then
  echo "setup: fetching axe-core into $axe" >&2
  mkdir -p target/interop
  npm pack --silent --pack-destination target/interop axe-core@4.14.1 >/dev/null || true
  # One judge of a page; all others go on without it, and its test says that it did not run.
  has_axe || { echo "setup: axe-core was not fetched: npm is missing, or has not given the file of its checksum" >&2; rm -f "$axe"; }
fi
if wanted icount && ((${#rig[@]})); then
  echo "setup: installing ${rig[*]} from Debian" >&2
  scripts/apt.sh install "${rig[@]}"
fi
if wanted kernel && [[ ! -x $kernel ]]; then
  echo "setup: no kernel with virtual time at $kernel; building one (about 8 minutes, once)" >&2
  scripts/build_timetravel_kernel.sh "$kernel"
fi
