#!/usr/bin/env python3
"""What reconstruction gains while the head moves, and what it costs, scene by scene.

    scripts/moving_head.py [--program P] [--size WxH] [--spp N] [--frames N] [--motion M] [--out DIR]
                           [--variant "NAME=FLAGS"]... "SCENE=FLAGS"...

Runs every variant of settings (without --variant: `raw`, with reconstruction off, and `default`) over a simulated head's
first frames, interleaved, and compares both eyes of the last frame with a path-traced frame from its pose: N samples spread
over each pixel. Prints a line of a table per scene and variant: RMSE of the tone-mapped pictures in display light, mean
radiance of the last 16 frames over the reference's, device milliseconds per frame (lower quartile: whatever else
the machine does only adds to them), and both over the first variant's. References in
DIR are used again if they are there.
"""
import argparse
import json
import pathlib
import shlex
import statistics
import subprocess

# One frame's brightness depends on which of a small lamp's or the sun's edges its offset meets.
BRIGHTNESS_FRAMES = 16
RAW = " ".join(f"--set reconstruct.{key}=off" for key in ("svgf", "taa", "still"))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--program", default="target/release/stereolux")
    parser.add_argument("--size", default="96x96")
    parser.add_argument("--spp", default="4096")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--motion", default="sway")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/moving_head"))
    parser.add_argument("--variant", action="append", default=[])
    return parser.parse_args()


def call(options, *words):
    done = subprocess.run([options.program, *map(str, words)], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{shlex.join(map(str, words))}: {done.stderr.strip()}")
    return done.stdout


def run(options, scene, flags, out, *more):
    call(options, "run", *scene, *flags, "--session", "simulated", "--motion", options.motion, "--size", options.size,
         "--frames", options.frames, "--every", 1, "--out", out, *more)
    lines = (out / "stats.jsonl").read_text().splitlines()[options.frames // 4:]
    return [sum(json.loads(line)["pass_ms"].values()) for line in lines]


def pose_of(trace):
    """The head between the eyes in the last frame of a recording, as --pose takes it."""
    left, right = json.loads(trace.read_text().splitlines()[-1])["views"]
    place = [(a + b) / 2 for a, b in zip(left["position"], right["position"])]
    return " ".join(str(number) for number in place + left["orientation"])


def judge(options, out, reference):
    def metrics(frame, end):
        return json.loads(call(options, "compare", out / f"frame_{frame:04}{end}", reference / f"frame_0000{end}"))

    shown = metrics(options.frames - 1, ".png")["rmse"]
    frames = range(options.frames - BRIGHTNESS_FRAMES, options.frames)
    biases = [metrics(frame, f"_{eye}.exr")["mean_rel_bias"] for frame in frames for eye in ("left", "right")]
    return shown, 1 + statistics.mean(biases)


def main():
    options = arguments()
    variants = [variant.split("=", 1) for variant in options.variant] or [["raw", RAW], ["default", ""]]
    print("| scene | variant | RMSE | over the first | brightness | ms per frame | over the first |")
    print("|---|---|---|---|---|---|---|")
    for scene in options.scenes:
        name, flags = scene.split("=", 1)
        flags = shlex.split(flags)
        folder = options.out / name
        trace, reference = folder / "views.jsonl", folder / f"reference_{options.size}_{options.spp}_{options.motion}"
        folder.mkdir(parents=True, exist_ok=True)
        times = {name: [] for name, _ in variants}
        for _ in range(options.rounds):
            for variant, more in variants:
                out = folder / variant
                times[variant] += run(options, flags, shlex.split(more), out, "--record", trace)
        if not (reference / "run.json").exists():
            call(options, "render", *flags, "--method", "path", "--reuse", "off", "--spp", options.spp, "--size",
                 options.size, "--pose", pose_of(trace), "--out", reference)
        first = None
        for variant, _ in variants:
            error, brightness = judge(options, folder / variant, reference)
            ms = statistics.quantiles(times[variant], n=4)[0]
            first = first or (error, ms)
            print(f"| {name} | {variant} | {error:.4f} | {error / first[0]:.2f} | {brightness:.3f} | {ms:.1f} "
                  f"| {ms / first[1]:.2f} |", flush=True)


main()
