#!/usr/bin/env bash
# What sets promise with a friction prior that is wrong: by -0.6 to 0.6, of any sigma.
#
#     tests/plants/wrong_priors.sh FROM [DRIVES] [ROWS]
#
# DRIVES drives of the reference car (25 s) from seed FROM on, one process. ROWS (default: tests/results/identification/envelope_priors.csv) receives a
# row a drive; one that is there already is not driven again: broken off, it goes on where it was. tests/results/identification/envelope.py
# makes the table.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
from=$1 drives=${2:-500} rows=${3:-$root/tests/results/identification/envelope_priors.csv}
program=${ENVELOPE:-}
if [ -z "$program" ]; then
    cargo build --release --manifest-path "$root/Cargo.toml" -p gripsight_identification --example envelope
    program=${CARGO_TARGET_DIR:-$root/target}/release/examples/envelope
fi
for ((seed = from; seed < from + drives; seed++)); do
    if [ -f "$rows" ] && grep -q " seed $seed pace" "$rows"; then continue; fi
    "$program" priors "$seed" $((seed + 1)) 25 > "$rows.next"
    if [ -f "$rows" ]; then tail -n +2 "$rows.next" >> "$rows"; else cp "$rows.next" "$rows"; fi
    rm "$rows.next"
done
