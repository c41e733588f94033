#!/usr/bin/env bash
# Installs what the tests need and runs all of them: formatting, lints, documentation, shader validation, limits on what
# passes become on a GPU, tests, doc tests.
# Prints the ten slowest tests and the total, also when some fail.
# On a software adapter unless STEREOLUX_TEST_ADAPTER names another (a part of its name, or `any`).
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/setup.sh

ensure_build_tools
ensure_vulkan
ensure_radv
ensure_test_tools
# The fake runtime has no tests of its own.
documented=(-p stereolux)
for crate in base bvh gpu images report scene settings xr; do
    documented+=(-p "stereolux-$crate")
done
# It turns `internals` on, which users' documentation is without.
packages=("${documented[@]}" -p stereolux-isa)
cargo fmt --all --check
# One profile throughout, so that dependencies are compiled once.
cargo clippy --release --locked "${packages[@]}" --all-targets -- -D warnings
# What users get: without `internals`, which tests and examples turn on.
cargo clippy --release --locked --bin stereolux -- -D warnings
# What scripts/demo.sh builds.
cargo clippy --release --locked --bin stereolux --no-default-features -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --no-deps "${documented[@]}"
# Of the same packages as the tests: others' dependencies have other features, and half of all would be compiled twice.
cargo build --release --locked "${packages[@]}" --bins --examples
# What the passes become on a GPU.
"${CARGO_TARGET_DIR:-target}/release/stereolux-isa" --check >/dev/null

# Runs tests, their output shown as it comes and kept in $log.
log=$(mktemp)
trap 'rm -f "$log"' EXIT
began=$SECONDS
status=0
# libtest knows each test's time on the stable toolchain too, but says it only to a test binary that is told to take
# unstable flags; nothing is compiled with this variable.
cargo test --release --locked "${packages[@]}" --lib --bins --tests \
    --config 'target."cfg(all())".runner = ["env", "RUSTC_BOOTSTRAP=1"]' \
    -- -Z unstable-options --report-time | tee "$log" || status=$?
echo
echo "the ten slowest tests, seconds (tests run side by side):"
sed -nE 's/^test (.*) \.\.\. .*<([0-9.]+)s>$/\2 \1/p' "$log" | sort -rn | awk 'NR <= 10 { printf "%9.1f  %s\n", $1, $2 }'
echo "all tests and compiling them: $((SECONDS - began)) s"
[ "$status" -eq 0 ] || exit "$status"
cargo test --release --locked --doc "${documented[@]}"
