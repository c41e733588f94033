#!/usr/bin/env bash
# What every pass becomes on the instruction set of AMD's RDNA 2 and 3, without such a card: docs/gpu.md.
# Takes the tool's own flags: `scripts/gpu_isa.sh --help`.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/setup.sh

ensure_build_tools
ensure_radv
exec cargo run --quiet --release --locked -p stereolux-isa -- "$@"
