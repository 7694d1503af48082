#!/usr/bin/env bash
# Runs goniofit beside published solvers on the same tables and prints their times: see ../README.md.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: run.sh [OPTION]... [FOLDER]...

Fits Lambert + Phong to three made tables, and to every *.binary in each FOLDER, by goniofit and its peers.

  --scratch DIR    where everything is built and written (default: target/peers of this repository)
  --json FILE      where all numbers go (default: fit.json in the scratch folder)
  --rounds N       rounds over all solvers (default 5)
  --solves N       solves of each peer in a round (default 2)
  --threads N      threads of goniofit, Ceres and the floor (default 2)
  --goniofit BIN   the program to measure (default: this repository's, built in release)
  --install        install the packages that are missing
TEXT
}

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
scratch=$root/target/peers
json='' goniofit='' rounds=5 solves=2 threads=2 install=false folders=()
while [ $# -gt 0 ]; do
  case $1 in
    --scratch | --json | --rounds | --solves | --threads | --goniofit)
      [ $# -ge 2 ] || { usage >&2; exit 2; }
      declare "${1#--}=$2"
      shift ;;
    --install) install=true ;;
    -h | --help) usage; exit ;;
    -*) usage >&2; exit 2 ;;
    *) folders+=("$1") ;;
  esac
  shift
done
mkdir -p "$scratch/bin"
scratch=$(cd "$scratch" && pwd)
json=${json:-$scratch/fit.json}

say() { printf '%s\n' "$*" >&2; }

say "packages"
missing=()
command -v g++ >/dev/null || missing+=(g++)
python3 -c 'import ensurepip, venv' 2>/dev/null || missing+=(python3-venv)
for package in libceres-dev libeigen3-dev libgoogle-glog-dev liblapack-dev libblas-dev; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  command=(apt-get install -y "${missing[@]}")
  [ "$(id -u)" = 0 ] || command=(sudo "${command[@]}")
  if $install; then
    "${command[@]}" >&2
  else
    say "missing: ${missing[*]}"
    say "install them (--install does it):  ${command[*]}"
    exit 1
  fi
fi

say "peers"
export PYTHONDONTWRITEBYTECODE=1
python=$scratch/venv/bin/python
if ! "$python" -c 'import numpy, scipy' 2>/dev/null; then
  python3 -m venv "$scratch/venv"
  "$python" -m pip install --quiet --disable-pip-version-check numpy scipy >&2
fi
# Each peer gets what this machine has; goniofit is built as anyone would.
g++ -std=c++17 -O3 -march=native -DNDEBUG -isystem /usr/include/eigen3 "$here/ceres_peer.cc" \
  -o "$scratch/bin/ceres_peer" -lceres -lglog
gcc -std=gnu17 -O3 -march=native -ffast-math -fopenmp -mprefer-vector-width=512 "$here/floor.c" \
  -o "$scratch/bin/floor" -lm
RUSTFLAGS='-C target-cpu=native' cargo build --quiet --release --locked \
  --manifest-path "$here/varpro_peer/Cargo.toml" --target-dir "$scratch/varpro_peer"
cp "$scratch/varpro_peer/release/varpro_peer" "$scratch/bin/"

say "goniofit"
if [ -z "$goniofit" ]; then
  built=${CARGO_TARGET_DIR:-$root/target}
  env -u RUSTFLAGS cargo build --quiet --release --locked --bin goniofit \
    --manifest-path "$root/Cargo.toml" --target-dir "$built"
  goniofit=$built/release/goniofit
fi

say "tables"
tables=$scratch/tables flat=$scratch/flat binaries=()
"$python" "$here/gen.py" "$tables"
for folder in ${folders[@]+"${folders[@]}"}; do
  found=("$folder"/*.binary)
  [ -e "${found[0]}" ] || { say "$folder: holds no .binary"; exit 2; }
  binaries+=("${found[@]}")
done
"$python" "$here/flatten.py" "$flat" "$tables"/{matte,glossy,mirror}.binary \
  ${binaries[@]+"${binaries[@]}"}

export OMP_NUM_THREADS=$threads OPENBLAS_NUM_THREADS=$threads
# compare.py itself needs no numpy, and stays small: a child's peak memory counts from its parent's size.
"$python" "$here/compare.py" --goniofit "$goniofit" --bin "$scratch/bin" --python "$python" \
  --tables "$tables" --flat "$flat" --json "$json" \
  --rounds "$rounds" --solves "$solves" --threads "$threads" -- ${binaries[@]+"${binaries[@]}"}
say "all numbers: $json"
