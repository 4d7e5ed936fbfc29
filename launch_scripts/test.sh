#!/usr/bin/env bash
# Sets up what the tests need, then runs every check of the project.
set -euo pipefail
cd "$(dirname "$0")/.."
step() { printf '\n== %s (%s s)\n' "$1" "$SECONDS"; }

step "set-up"
launch_scripts/setup.sh --tests
export CARGO_TERM_COLOR=${CARGO_TERM_COLOR:-never} CARGO_INCREMENTAL=0

step "format"
cargo fmt --all -- --check

step "clippy"
cargo clippy --workspace --all-targets --locked -- -D warnings

step "build"
# The topic-level tests start the nodes' binaries, which a test run alone does not build.
cargo build --workspace --bins --examples --locked

step "tests"
if cargo nextest --version >/dev/null 2>&1; then
    cargo nextest run --workspace --lib --bins --tests --locked --no-fail-fast
else
    cargo test --workspace --lib --bins --tests --locked --no-fail-fast
fi
cargo test --workspace --locked --doc --quiet

step "Python: road renderer, warm start, subscribers"
.venv/bin/python -m pytest -q -p no:cacheprovider nodes/camera_prior/training/test_render.py tests/results/test_figures.py tests/results/camera_prior nodes/identifier/examples

step "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet

step "all checks passed"
