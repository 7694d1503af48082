#!/usr/bin/env bash
# Instructions of one simulation (callgrind): each effect left out by name against an instrument without its part, which makes the same readings; and, not
# judged, the ideal instrument against a loop over f·cosθo, which makes no raw readings. Needs valgrind. Exits with 1 where two differ by more than 2 %.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${1:-}
if [ -z "$program" ]; then
  program=$(cargo bench --bench effects --no-run --locked --message-format=json 2>/dev/null |
    grep -o '"executable":"[^"]*effects-[^"]*"' | tail -1 | cut -d'"' -f4)
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

count() { # instructions of the program with these arguments, on one thread
  RAYON_NUM_THREADS=1 valgrind --tool=callgrind --callgrind-out-file="$folder/out" "$program" --once "$@" >/dev/null 2>"$folder/log"
  awk '/^(summary|totals):/ { n = $2 } END { print n }' "$folder/out"
}

wrong=0
compare() { # name, instructions with it off, instructions without it
  share=$(awk -v a="$2" -v b="$3" 'BEGIN { printf "%.4f", 100 * (a / b - 1) }')
  echo "| $1 | $2 | $3 | $share % |"
}

judge() {
  compare "$@"
  awk -v s="$share" 'BEGIN { exit !(s > 2 || s < -2) }' && wrong=1 || true
}

echo "| effect off | instructions | without it | more |"
echo "|---|---|---|---|"
compare "all, against a bare loop" "$(count ideal)" "$(count by-hand)"
shift || true
effects=("$@")
[ ${#effects[@]} -gt 0 ] || effects=("axis zeros" "axis jitter" "sample tilt" "sample height" "spot extent" "source divergence" "detector aperture" "spectral band" "footprint" "shadow"
  "stray light" "source drift" "dark current" "exposure times" "electronic offset" "saturation" "nonlinearity" "read noise" "quantisation")
for effect in "${effects[@]}"; do
  judge "$effect" "$(count left-out "$effect")" "$(count without "$effect")"
done
exit $wrong
