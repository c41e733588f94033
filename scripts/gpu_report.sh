#!/usr/bin/env bash
# Everything that is to be known of this machine's GPU, in one file: scripts/gpu_report.sh [--adapter NAME] [--out DIR]
#   --scene NAME=SCENE[+SKY]  measures stereo reuse in this scene, too; may be given several times
#   --adapter NAME  part of the adapter's name; the best one without it
#   --out DIR       where report.md and the runs go (out/gpu)
#   --size WxH      pixels per eye (2064x2208, quest3's)
#   --frames N      measured frames of a run (120)
#   --no-tests      measures without running the tests on the adapter first
# Tests first, then frames, throughput of the stages, memory. Takes about half an hour on a GPU, most of it compiling.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/setup.sh

adapter="" out=out/gpu size=2064x2208 frames=120 tests=yes scenes=()
while [ $# -gt 0 ]; do
    case "$1" in
    --adapter | --out | --size | --frames)
        [ $# -ge 2 ] || { echo "error: $1 takes a value" >&2 && exit 2; }
        printf -v "${1#--}" %s "$2"
        shift 2
        ;;
    --scene)
        [ $# -ge 2 ] || { echo "error: $1 takes a value" >&2 && exit 2; }
        scenes+=(--scene "$2")
        shift 2
        ;;
    --no-tests)
        tests=no
        shift
        ;;
    *)
        echo "error: $1: unknown; the flags are --adapter, --out, --scene, --size, --frames and --no-tests" >&2
        exit 2
        ;;
    esac
done

ensure_build_tools
ensure_vulkan
mkdir -p "$out"
cargo build --release --locked --bin stereolux
program="${CARGO_TARGET_DIR:-target}/release/stereolux"
log=""
if [ "$tests" = yes ]; then
    ensure_test_tools
    log="$out/tests.log"
    # What fails is in the report; measuring goes on.
    STEREOLUX_TEST_ADAPTER="${adapter:-any}" cargo test --release --locked --test suite -- --test-threads 1 2>&1 |
        tee "$log" || true
fi
exec python3 scripts/gpu_report.py --program "$program" --adapter "$adapter" --out "$out" --size "$size" --frames "$frames" \
    --tests "$log" "${scenes[@]}"
