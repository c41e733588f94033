#!/usr/bin/env python3
"""The measuring half of scripts/gpu_report.sh: runs the program on an adapter and writes report.md.

Every figure is of the device's timestamps unless it says wall. Frames in which photons are traced, and the first ones, while
buffers grow and histories are short, are told apart from the others.
"""
import argparse
import itertools
import json
import pathlib
import re
import statistics
import subprocess
import sys

WARM_UP = 8
BUDGET_MS = 1000 / 90
EVERY = ["--set", "photon.every_frame=true"]
RAW = [word for key in ("svgf", "taa", "still") for word in ("--set", f"reconstruct.{key}=off")]
# Name, arguments.
RUNS = [
    ("cornell", ["--scene", "builtin:cornell"]),
    ("cornell, photons every frame", ["--scene", "builtin:cornell", *EVERY]),
    ("gallery", ["--scene", "builtin:gallery"]),
    ("gallery, no filters", ["--scene", "builtin:gallery", *RAW]),
    ("gallery, photons every frame", ["--scene", "builtin:gallery", *EVERY]),
    ("gallery, paths", ["--scene", "builtin:gallery", "--set", "method=path"]),
    ("cornell, photons every frame, gathered at full rate",
     ["--scene", "builtin:cornell", "--set", "photon.half_rate=off", *EVERY]),
    ("gallery, photons every frame, gathered at full rate",
     ["--scene", "builtin:gallery", "--set", "photon.half_rate=off", *EVERY]),
    ("parade, everything moves", ["--scene", "builtin:parade", *EVERY]),
    ("terrain, 1.7 million triangles, paths", ["--scene", "builtin:terrain", "--set", "method=path"]),
]
SCENES = ["cornell=builtin:cornell", "gallery=builtin:gallery"]
REUSE = ("off", "scatter", "lookup")
METHODS = {"photons": EVERY, "paths": ["--set", "method=path"]}
SORT = ("photon_bounds", "grid_setup", "cell_count", "radix_count", "radix_scatter", "scan_blocks", "scan_add",
        "photon_reorder")


def fail(text):
    print(f"error: {text}", file=sys.stderr)
    sys.exit(1)


class Failed(Exception):
    """A command that did not end well; the others are measured all the same."""


def call(arguments):
    done = subprocess.run([str(word) for word in arguments], capture_output=True, text=True)
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()
        raise Failed(f"{' '.join(str(word) for word in arguments)}: {said[-1] if said else f'exit status {done.returncode}'}")
    return done.stdout


def quantile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


class Run:
    """One run's stats.jsonl and run.json."""

    def __init__(self, options, name, arguments):
        self.name = name
        folder = options.out / re.sub(r"\W+", "_", name)
        self.command = [options.program, "run", "--session", "simulated", "--headset", "quest3", "--size", options.size,
                        "--frames", options.frames + WARM_UP, "--set", "output.images=false", "--out", folder, *arguments]
        if options.adapter:
            self.command += ["--adapter", options.adapter]
        call(self.command)
        frames = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
        self.about = json.loads((folder / "run.json").read_text())
        if not self.about["timestamps"]:
            fail(f"{self.about['adapter']['name']} has no timestamp queries; nothing can be measured")
        self.tracing = [frame for frame in frames if frame["photons"] and frame["photons"]["traced"]]
        self.frames = frames[WARM_UP:]
        self.pixels = self.about["size"][0] * self.about["size"][1]

    def gpu(self, part):
        return [frame["gpu_ms"][part] for frame in self.frames]

    def median(self, part):
        return statistics.median(self.gpu(part))

    def passes(self, frames, chosen):
        """Median over frames of the sum of the passes that `chosen` likes, ms; None where none ran."""
        sums = [[ms for name, ms in frame["pass_ms"].items() if chosen(name)] for frame in frames]
        sums = [sum(found) for found in sums if found]
        return statistics.median(sums) if sums else None


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]


def frames_table(runs):
    head = ["run", "median, ms", "p99, ms", "left", "right", "photons", "filters", "right over left", "reused, %", "frames/s, wall"]
    rows = []
    for run in runs:
        stereo = [frame["stereo"]["reuse_fraction"] for frame in run.frames if frame["stereo"]]
        reused = f"{100 * statistics.median(stereo):.0f}" if stereo else ""
        left, right = run.median("left"), run.median("right")
        p99 = quantile(run.gpu("total"), 0.99)
        rows.append([run.name, f"{run.median('total'):.2f}", f"{p99:.2f}{'' if p99 <= BUDGET_MS else ' *'}", f"{left:.2f}",
                     f"{right:.2f}", f"{run.median('photons'):.2f}", f"{run.median('reconstruction'):.2f}",
                     f"{right / left:.2f}" if left else "", reused, f"{run.about['frames_per_second']:.1f}"])
    return table(head, rows)


def reuse_table(runs):
    """Both eyes beside two by themselves: `runs` by scene, method and reuse."""
    head = ["scene", "method", "two separate eyes, ms", "scatter", "lookup", "scatter, times as fast", "lookup"]
    rows = []
    for (scene, method), of in runs.items():
        ms = [of[reuse].median("total") if reuse in of else None for reuse in REUSE]
        said = lambda value: "failed" if value is None else f"{value:.2f}"
        ratios = [None if ms[0] is None or other is None else ms[0] / other for other in ms[1:]]
        rows.append([scene, method, *(said(value) for value in [*ms, *ratios])])
    return table(head, rows)


def rate(count, ms):
    return "" if ms is None or not count else f"{count / ms / 1000:.3g}"


def throughput_table(runs):
    head = ["run", "primary rays", "photon paths", "photons sorted", "gather points"]
    rows = []
    for run in runs:
        if not run.tracing:
            continue
        maps = run.tracing[-1]["photons"]
        caustics = maps.get("caustics") or {"emitted": 0, "stored": 0}
        hits = statistics.median(frame["stereo"]["left_hits"] for frame in run.frames) if run.frames[0]["stereo"] else run.pixels
        gathers_all = run.about["settings"]["photon"]["half_rate"] == "off"
        of_map = lambda words: lambda name: name.startswith("photons.") and name.rsplit(".", 1)[1] in words
        rows.append([
            run.name,
            rate(run.pixels, run.passes(run.frames, lambda name: name == "left.first_hits")),
            rate(maps["emitted"] + caustics["emitted"], run.passes(run.tracing, of_map(("photon_trace", "caustic_trace")))),
            rate(maps["stored"] + caustics["stored"], run.passes(run.tracing, of_map(SORT))),
            rate(hits, run.passes(run.frames, lambda name: name == "left.photon_gather")) if gathers_all else "",
        ])
    return table(head, rows)


def passes_table(run):
    names = sorted({name for frame in run.frames for name in frame["pass_ms"]})
    rows = [(name, run.passes(run.frames, lambda other, name=name: other == name)) for name in names]
    rows.sort(key=lambda row: -row[1])
    total = sum(ms for _, ms in rows)
    return table(["pass", "median, ms", "of all, %", "ns per pixel"],
                 [[f"`{name}`", f"{ms:.3f}", f"{100 * ms / total:.1f}", f"{1e6 * ms / run.pixels:.2f}"] for name, ms in rows])


def memory_table(options):
    head = ["frame", "all, GB", "eyes", "shared", "photons"]
    rows = []
    for name, arguments in RUNS:
        if "every frame" in name:
            continue  # as the map that stays
        said = call([options.program, "info", *arguments, "--set", f"size={options.size}"])
        memory = json.loads(said)["scene"]["memory"]
        parts = ("total", "eyes", "shared", "photons")
        rows.append([name] + [f"{memory[f'{part}_bytes'] * 1e-9:.2f}" for part in parts])
    return table(head, rows)


def tests_said(path):
    if not path:
        return ["Not run (`--no-tests`)."]
    text = pathlib.Path(path).read_text()
    result = re.findall(r"^test result: .*$", text, re.M)
    failed = re.findall(r"^test (\S+) \.\.\. FAILED", text, re.M)
    lines = [result[-1] if result else "The tests did not end; see tests.log."]
    return lines + [f"- failed: `{name}`" for name in failed]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, required=True)
    parser.add_argument("--adapter", default="")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--size", default="2064x2208")
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--tests", default="")
    parser.add_argument("--scene", action="append", default=[], metavar="NAME=SCENE[+SKY]")
    options = parser.parse_args()
    if wrong := [scene for scene in options.scene if "=" not in scene]:
        fail(f"--scene {wrong[0]}: NAME=SCENE or NAME=SCENE+SKY is wanted")
    if options.frames < 1:
        fail("--frames: at least 1")
    failures = []

    def measured(name, arguments):
        print(name, file=sys.stderr, flush=True)
        try:
            return Run(options, name, arguments)
        except Failed as failed:
            print(f"failed: {failed}", file=sys.stderr, flush=True)
            failures.append((name, failed))
            return None

    runs = [run for run in (measured(name, arguments) for name, arguments in RUNS) if run]
    of_scenes = {}
    for scene, method in itertools.product([*SCENES, *options.scene], METHODS):
        name, place = scene.split("=", 1)
        path, _, sky = place.partition("+")
        arguments = ["--scene", path, *METHODS[method], *(["--set", f"environment.path={sky}"] if sky else [])]
        found = {reuse: measured(f"{name}, {method}, reuse {reuse}", [*arguments, "--set", f"reuse={reuse}"]) for reuse in REUSE}
        of_scenes[name, method] = {reuse: run for reuse, run in found.items() if run}
    every_frame = [run for run in runs if "every frame" in run.name]
    every_frame += [run for (_, method), of in of_scenes.items() if method == "photons" for run in of.values()]
    if not every_frame:
        fail(f"nothing to report: {failures[0][1]}")
    every = runs + [run for of in of_scenes.values() for run in of.values()]
    about = every[0].about
    adapter = about["adapter"]
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True).stdout.strip()
    width, height = about["size"]
    best = min(every_frame, key=lambda run: quantile(run.gpu("total"), 0.99))
    p99 = quantile(best.gpu("total"), 0.99)
    lines = [
        f"# stereolux on {adapter['name']}", "",
        f"Commit {commit or 'unknown'}; {adapter['kind']} adapter, {adapter['backend']}, {adapter['driver']} {adapter['driver_info']}; "
        f"{width}x{height} pixels per eye, {options.frames} frames after {WARM_UP}.", "",
    ]
    if about["software_adapter"]:
        lines += ["**A software adapter: its times say nothing about a GPU.**", ""]
    verdict = "met" if p99 <= BUDGET_MS else "missed"
    lines += [
        f"Both eyes with photons traced in every frame, 99 of 100 frames within: {p99:.2f} ms ({best.name}); the goal of "
        f"{BUDGET_MS:.1f} ms is {verdict}.", "",
        "## Tests on this adapter", "", *tests_said(options.tests), "",
        "## Frames", "", *[f"Failed: {name}: `{failed}`" for name, failed in failures], *([""] if failures else []),
        "Device milliseconds, medians over frames; * is over the budget of 90 Hz.", "", *frames_table(runs), "",
        "## The second eye", "", "Default settings, photons traced in every frame, or paths.", "", *reuse_table(of_scenes), "",
        "## Throughput", "", "Millions per second of device time of the passes that do it.", "", *throughput_table(runs), "",
        "## Passes", "",
    ]
    for run in runs:
        if run.name in ("gallery, photons every frame", "gallery, paths"):
            lines += [f"### {run.name}", "", *passes_table(run), ""]
    lines += ["## Memory of the frame's buffers", "", "By count (`stereolux info`).", "", *memory_table(options), "",
              "## Commands", "", "```sh", *(" ".join(str(word) for word in run.command) for run in every), "```", ""]
    (options.out / "report.md").write_text("\n".join(lines))
    print(options.out / "report.md")
    if failures:
        sys.exit(1)


if __name__ == "__main__":
    try:
        main()
    except Failed as failed:
        fail(failed)
