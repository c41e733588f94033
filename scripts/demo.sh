#!/usr/bin/env bash
# Sets everything up and renders ten stereo frames of the embedded gallery with the simulated headset.
#   scripts/demo.sh [other flags of `stereolux run`]
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/setup.sh

ensure_build_tools
ensure_vulkan
# The headless program is enough and compiles faster, unless the whole one's dependencies are there already: it would
# take the place of the whole one.
features=--no-default-features
target=${CARGO_TARGET_DIR:-target}
compgen -G "$target/release/deps/libegui-*.rlib" >/dev/null && features=
cargo build --release --locked --bin stereolux $features
"$target/release/stereolux" run --session simulated --scene builtin:gallery --size 256x256 --frames 10 --every 9 \
    --out out/demo "$@"
echo
echo "pictures (both eyes side by side), the first and the tenth frame: out/demo/frame_0000.png, out/demo/frame_0009.png"
echo "where the right eye's pixels came from: out/demo/frame_0009_reuse.png"
echo "linear radiance per eye: out/demo/frame_0009_left.exr, out/demo/frame_0009_right.exr"
echo "milliseconds per pass and reuse, frame by frame: out/demo/stats.jsonl; settings and medians: out/demo/run.json"
[ -z "$features" ] ||
    echo "$target/release/stereolux is headless: \`cargo build --release\` adds view, bench and --mirror"
