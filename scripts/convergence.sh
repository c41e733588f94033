#!/usr/bin/env bash
# Progressive photon mapping against path tracing: relative MSE over the number of passes, its slope, and the error that
# a fixed radius keeps. Writes a Markdown table to stdout; takes a quarter of an hour on two idle cores.
#     scripts/convergence.sh [OUT] > table.md
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/convergence}
mkdir -p "$out"
: >"$out.notes"
: >"$out.log"
program=${STEREOLUX:-target/release/stereolux}
view=(--size 64x64 --eyes left)
passes="1 4 16 64"

# error IMAGE REFERENCE -> relative MSE
error() {
    "$program" compare "$1/frame_0000_left.exr" "$2/frame_0000_left.exr" | sed -n 's/.*"rel_mse": *\([-+.0-9e]*\).*/\1/p'
}

echo "| scene | radius | relMSE after $(echo $passes | sed 's/ /, /g') passes | slope | error kept |"
echo "|---|---|---|---|---|"
while read -r scene half spp; do
    fov="-$half $half $half -$half"
    shot=(--scene "builtin:$scene" --fov "$fov" "${view[@]}")
    for run in a b; do
        seed=$([ $run = a ] && echo 101 || echo 202)
        "$program" render "${shot[@]}" --method path --spp "$spp" --seed "$seed" --out "$out/$scene-path-$run" 2>>"$out.log"
    done
    # Two references of equal effort differ by twice the squared error of one.
    floor=$(error "$out/$scene-path-a" "$out/$scene-path-b")
    # An alpha next to 1 keeps the radius, so that its passes are independent maps of one radius.
    for alpha in 0.666667 0.999999; do
        errors=""
        for count in $passes; do
            folder="$out/$scene-$alpha-$count"
            "$program" render "${shot[@]}" --photons 65536 --spp "$count" --set photon.progressive=true \
                --set photon.progressive_alpha="$alpha" --out "$folder" 2>>"$out.log"
            errors="$errors $(error "$folder" "$out/$scene-path-a")"
        done
        echo "$scene $alpha $floor $passes $errors" | awk '{
            n = (NF - 3) / 2
            for (i = 1; i <= n; i++) { N[i] = $(3 + i); E[i] = $(3 + n + i) - $3 / 2; list = list (i > 1 ? ", " : "") sprintf("%.2e", E[i]) }
            # Least squares in log-log from the second point on: the first is one map.
            for (i = 2; i <= n; i++) { x = log(N[i]); y = log(E[i]); m++; sx += x; sy += y; sxx += x * x; sxy += x * y }
            slope = (m * sxy - sx * sy) / (m * sxx - sx * sx)
            # relMSE(N) = kept + rest / N where every pass is alike.
            kept = (N[n] * E[n] - N[n - 1] * E[n - 1]) / (N[n] - N[n - 1])
            fixed = ($2 > 0.9)
            printf "| %s | %s | %s | %s | %s |\n", $1, fixed ? "fixed" : "shrinks", list, fixed ? "" : sprintf("%.2f", slope), fixed ? sprintf("%.2e", kept) : ""
        }'
    done
    echo "reference of $scene: $spp samples per pixel, relMSE against the truth $(awk "BEGIN { printf \"%.1e\", $floor / 2 }")" >>"$out.notes"
done <<'SCENES'
cornell 21 2048
caustic 22 2048
gallery 40 512
SCENES
cat "$out.notes" >&2
