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
# What windows of the desktop mirror are opened with.
has_libraries libX11.so.6 libX11-xcb.so.1 libxcb.so.1 libXcursor.so.1 libXi.so.6 libxkbcommon.so.0 libxkbcommon-x11.so.0 ||
    apt_install libx11-6 libx11-xcb1 libxcb1 libxcursor1 libxi6 libxkbcommon0 libxkbcommon-x11-0
scripts/monado.sh --fetch
# With the packages under tests/.
cargo fmt --all --check
# One profile throughout, so that dependencies are compiled once.
cargo clippy --release --locked --all-targets -- -D warnings
# What scripts/demo.sh builds: it has the same dependencies, so that only the program itself is read again.
cargo clippy --release --locked --no-default-features -- -D warnings
cargo test --release --locked
