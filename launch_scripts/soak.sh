#!/usr/bin/env bash
# The whole suite beside a live car for an hour: processor, memory and latency over time, by a CycloneDDS peer. Needs a set-up tree.
# Usage: launch_scripts/soak.sh OUT [--seconds S] [--car NAME] [--track NAME] [--mu MU] [--bin FOLDER]
set -euo pipefail
cd "$(dirname "$0")/.."
if [[ " $* " != *" --bin "* && " $* " != *" --help "* ]]; then
    cargo build --locked --release --workspace --bins
    set -- "$@" --bin "${CARGO_TARGET_DIR:-target}/release"
fi
ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-93} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST exec setsid --wait .venv/bin/python tests/peers/soak.py "$@"
