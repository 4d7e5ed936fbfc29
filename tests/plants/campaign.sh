#!/usr/bin/env bash
# What sets promise, over seven plants: four cars of the reference car, slipx, and two cars of CommonRoad's multibody model.
#
#     tests/plants/campaign.sh OUT SEED [DRAWS] [FOREIGN]
#
# DRAWS drives of the reference car from SEED on (25 s), FOREIGN drives of others' plants drawn from SEED (30 s; Python packages of
# nodes/lib/reference_car/compare/requirements.txt), identified with v_y, and FOREIGN's again without it. OUT receives the bags; the rows and the table go to
# tests/results/identification (plants_*.csv, plants.md). Ended early it keeps what it has: run plants.py for the table.
set -euo pipefail
out=$1 seed=$2 draws=${3:-600} foreign=${4:-100}
root=$(cd "$(dirname "$0")/../.." && pwd)
results=$root/tests/results/identification
python=${PYTHON:-python3}
cd "$root"
cargo build --release -p gripsight_identification --example envelope --example signals
bin=${CARGO_TARGET_DIR:-target}/release/examples
"$bin/envelope" draws "$seed" $((seed + draws)) 25 > "$results/plants_draws.csv" &
"$python" tests/plants/make_foreign_bags.py "$out" --draw "$foreign" --seed "$seed" --duration 30
"$bin/envelope" bags "$out"/* > "$results/plants_foreign.csv"
"$bin/signals" foreign "$out"/* > "$results/plants_no_v_y.csv"
wait
"$results/plants.py"
