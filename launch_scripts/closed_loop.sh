#!/usr/bin/env bash
# The loop closed: the reference car on roads that it does not know, from mu = 0.51, driven and identified in turns.
# Usage: launch_scripts/closed_loop.sh OUT [--quick] [more options; --help lists them]
# --experiment changes: the floor changes in the middle of each run, between dry and wet; OUT/changes.csv, a row a change.
# --experiment effects: a delay, a lag, a shifted v_y, a worn axle, without and with the diagnosis, told, and wrongly named; OUT/effects.csv, a row a lap.
# --experiment controllers: pursuit and predictive control beside each other, on the true tires; OUT/controllers.csv, a row a run.
# --controller mpc: predictive control steers in the other experiments; a folder holds the runs of one.
# --experiment picture: OUT/laps.svg, the picture of README.
# Writes OUT/laps.csv (a row a lap) and OUT/summary.md, which also goes to standard output. --quick: minutes instead of an hour, and a run drawn (OUT/laps.svg).
# What these hold already is not driven again: a run that was broken off goes on.
set -euo pipefail
out=${1:?usage: launch_scripts/closed_loop.sh OUT [--quick]}
shift
case $out in -*) ;; /*) ;; *) out=$PWD/$out ;; esac
cd "$(dirname "$0")/.."

# What takes minutes runs with the build that the tests share; what takes an hour is worth one of its own.
profile=release
for option; do [[ $option == --quick ]] && profile=dev; done
cargo build --locked --profile "$profile" -p gripsight_driving --example closed_loop
exec "${CARGO_TARGET_DIR:-target}/${profile/dev/debug}/examples/closed_loop" "$out" "$@"
