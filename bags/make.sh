#!/usr/bin/env bash
# Makes the demo bags: make.sh [FOLDER]. GRIPSIGHT names the command, else it is built.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-bags}
gripsight=${GRIPSIGHT:-}
if [ -z "$gripsight" ]; then
    cargo build --release --locked -p gripsight
    gripsight=target/release/gripsight
fi
mkdir -p "$folder"
common=(--driver profile --pace 0.92 --realistic --effect steering_delay=0.04 --duration 30 --seed 7)
"$gripsight" simulate --car f1tenth --track esses --mu 0.9 --dither 0.02 "${common[@]}" --out "$folder/demo_f1tenth.mcap"
"$gripsight" simulate --car race_car --track club --mu 1.1 --dither 0.003 "${common[@]}" --out "$folder/demo_race_car.mcap"
