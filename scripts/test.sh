#!/usr/bin/env bash
# Installs what the tests need and runs all of them: formatting, lints, shader validation, tests, doc tests.
# On a software adapter unless STEREOLUX_TEST_ADAPTER names another (a part of its name, or `any`).
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/setup.sh

ensure_build_tools
ensure_vulkan
# The OpenXR tests run against Monado, fetched once into a cache folder, and read its picture off a virtual screen.
command -v Xvfb >/dev/null || apt_install xvfb
scripts/monado.sh --fetch
cargo fmt --check
# One profile throughout, so that dependencies are compiled once.
cargo clippy --release --locked --all-targets -- -D warnings
cargo test --release --locked
