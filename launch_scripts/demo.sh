#!/usr/bin/env bash
# Sets gripsight up, builds it and identifies the tires of the demo bag.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/demo}
launch_scripts/setup.sh
cargo build --release --locked -p gripsight
target/release/gripsight identify bags/demo_f1tenth.mcap --vehicle bags/demo_f1tenth.vehicle.yaml --out "$out"
printf '\nThe report: %s/report.html\n' "$out"
