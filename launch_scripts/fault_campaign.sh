#!/usr/bin/env bash
# A campaign of faults: drives of the reference car through the suite, each also without faults. Needs a set-up tree (launch_scripts/setup.sh).
# Usage: launch_scripts/fault_campaign.sh OUT [--faults N] [--seed S] [more options; --help lists them]
# Writes OUT/runs.csv (a row a run), OUT/faults.csv (a row a fault), OUT/README.md and the nodes' logs. About 15 s for ten faults.
set -euo pipefail
out=${1:?usage: launch_scripts/fault_campaign.sh OUT [--faults N] [--seed S]}
shift
case $out in -*) set -- "$out" "$@"; out=. ;; /*) ;; *) out=$PWD/$out ;; esac
cd "$(dirname "$0")/.."

folder=${CARGO_TARGET_DIR:-target}/release
if [[ " $* " != *" --bin "* && " $* " != *" --help "* ]]; then
    packages=(gripsight gripsight_telemetry gripsight_s4_residual gripsight_identifier gripsight_camera_prior gripsight_bag_player gripsight_fault_injector)
    cargo build --locked --release "${packages[@]/#/-p}"
    set -- "$@" --bin "$folder"
fi
exec .venv/bin/python tests/peers/fault_campaign.py "$out" "$@"
