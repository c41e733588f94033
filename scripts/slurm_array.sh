#!/bin/sh
# The parts of a suite or a run as a Slurm array job; a second job merges them when all are done.
#
#   scripts/slurm_array.sh PARTS OUT bench SUITE [OPTION...]
#   scripts/slurm_array.sh PARTS OUT run FRAMES [OPTION...]
#
# SBATCH_* variables are sbatch's own (SBATCH_PARTITION, SBATCH_TIMELIMIT, SBATCH_GRES=gpu:1); STEREOLUX as in parts.sh.
# OUT is a folder that all nodes see. Parts whose times are to be compared must run on nodes that are alike.
set -eu
if [ "${1-}" = part ]; then
    # Within the array: sbatch runs a copy of this script, so parts.sh is named by its full path.
    parts_script=$2
    shift 2
    exec "$parts_script" part "$SLURM_ARRAY_TASK_ID" "$@"
fi
if [ "${1-}" = merge ]; then
    exec "$2" merge "$3" "$4"
fi
[ $# -ge 4 ] || { echo "slurm_array.sh: give PARTS OUT bench SUITE or PARTS OUT run FRAMES" >&2; exit 2; }
command -v sbatch > /dev/null || { echo "slurm_array.sh: no sbatch here; scripts/parts.sh all needs no Slurm" >&2; exit 2; }
parts=$1 out=$2
parts_script=$(cd "$(dirname "$0")" && pwd)/parts.sh
mkdir -p "$out"
array=$(sbatch --parsable --job-name stereolux-part --array "1-$parts" --output "$out/part%a.log" \
    "$0" part "$parts_script" "$@")
sbatch --parsable --job-name stereolux-merge --dependency "afterok:${array%%;*}" --output "$out/merge.log" \
    "$0" merge "$parts_script" "$parts" "$out"
