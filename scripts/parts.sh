#!/bin/sh
# A suite or a run in parts, and one report of all.
#
#   scripts/parts.sh all PARTS OUT bench SUITE [OPTION...]      all parts by GNU parallel, then merge
#   scripts/parts.sh all PARTS OUT run FRAMES [OPTION...]       the same for the first FRAMES frames of a run
#   scripts/parts.sh part I PARTS OUT bench|run ...             part I alone, from 1: for schedulers, see slurm_array.sh
#   scripts/parts.sh merge PARTS OUT                            merge alone
#
# Parts go to OUT/part1, OUT/part2, ..., the whole to OUT/whole. A suite that was stopped goes on with the same command.
# STEREOLUX: the program, target/release/stereolux unless given. JOBS: parts at a time, 1 unless given. HOSTS: machines that see the same folders,
# as parallel's --sshlogin takes them.
set -eu
program=${STEREOLUX:-target/release/stereolux}

fail() {
    echo "parts.sh: $1; scripts/parts.sh has examples at its top" >&2
    exit 2
}

whole_number() {
    case $1 in '' | *[!0-9]* | 0*) fail "$2 is '$1' and must be a whole number above 0" ;; esac
}

part() {
    [ $# -ge 5 ] || fail "part takes I PARTS OUT bench SUITE or I PARTS OUT run FRAMES"
    number=$1 parts=$2 out=$3 command=$4 what=$5
    shift 5
    whole_number "$number" I
    whole_number "$parts" PARTS
    case $command in
        bench) exec "$program" bench "$what" "$@" --shard "$number/$parts" --out "$out/part$number" ;;
        run)
            whole_number "$what" FRAMES
            [ "$what" -ge "$parts" ] || fail "$what frames cannot be cut into $parts parts"
            exec "$program" run "$@" --range "$(((number - 1) * what / parts))..$((number * what / parts))" \
                --out "$out/part$number"
            ;;
        *) fail "'$command' cannot be cut; give bench or run" ;;
    esac
}

merge() {
    [ $# -eq 2 ] || fail "merge takes PARTS OUT"
    parts=$1 out=$2
    whole_number "$parts" PARTS
    set --
    number=1
    while [ "$number" -le "$parts" ]; do
        set -- "$@" "$out/part$number"
        number=$((number + 1))
    done
    "$program" merge "$@" --out "$out/whole"
}

all() {
    [ $# -ge 4 ] || fail "all takes PARTS OUT bench SUITE or PARTS OUT run FRAMES"
    parts=$1 out=$2
    shift 2
    whole_number "$parts" PARTS
    command -v parallel > /dev/null || fail "GNU parallel is not installed (apt install parallel)"
    export STEREOLUX="$program"
    seq "$parts" | parallel --will-cite --quote --halt now,fail=1 --line-buffer --tagstring 'part {}' \
        --jobs "${JOBS:-1}" --env STEREOLUX --workdir "$PWD" ${HOSTS:+--sshlogin "$HOSTS"} \
        "$0" part {} "$parts" "$out" "$@"
    merge "$parts" "$out"
}

[ $# -ge 1 ] || fail "say all, part or merge"
action=$1
shift
case $action in
    all | part | merge) "$action" "$@" ;;
    *) fail "'$action' is none of all, part, merge" ;;
esac
