#!/usr/bin/env python3
"""Path tracer's speed beside Mitsuba 3's on the same cores: samples per second, and time to a given error.

Setting up (Debian 12):
    cargo build --release
    python3 -m venv VENV && VENV/bin/pip install mitsuba==3.9.1
    apt-get install libllvm19        # or DRJIT_LIBLLVM_PATH=/path/to/libLLVM.so

Using:
    VENV/bin/python scripts/speed_mitsuba.py

renders the Cornell box at 256x256 by both, in turn, and prints medians with quartiles. Mitsuba runs its own `path`
integrator, `perspective` camera, `diffuse` surfaces and box filter in the variant llvm_ad_rgb (the package has no LLVM
variant without gradients; none are recorded here), on all cores. Its intersections are Embree's. Both draw independent
random numbers and follow paths to the same depth, one light sample per shadow ray, without Russian roulette; with --best each
does what takes it to an equal error fastest: stereolux as it comes (Sobol points, roulette, lights chosen from several
samples), Mitsuba with its `ldsampler` and its roulette from the fifth segment on, as it comes.

- A round renders with each in turn, at each of --spp samples per pixel; rounds before the first counted one are dropped.
- stereolux's time is that of its passes by timestamps, Mitsuba's from the call of render to the end of its kernels.
  Neither counts compiling, loading or writing.
- Error is relMSE, mean of (image - r)^2 / (r^2 + 0.01 mean r^2) over the reference r, less r's own share. The reference
  is Mitsuba's, --reference-spp samples in 8 batches. Time to an error E is time times error over E, as the error of
  either falls as 1 / samples; the table shows error times samples, so that one sees whether it does.
- Exit status 1 if the two do not show the same picture: their means differ by over 1 %, or the error does not fall.
"""

import argparse
import json
import math
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import reference_mitsuba as reference
from reference_models import Refused, define_plugins

BATCHES = 8
# No path is as long.
NEVER = 1000000


def relative(squares, truth):
    """Mean of `squares` over the reference's, as crates/images/src/metrics/comparison.rs has it."""
    return float(np.mean(squares / (truth**2 + 0.01 * np.mean(truth**2))))


def relative_mse(image, truth):
    return relative((image - truth) ** 2, truth)


def quartiles(values):
    if len(values) < 2:
        return f"{values[0]:.4g}"
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return f"{middle:.4g} ({low:.4g} to {high:.4g})"


class Mitsuba:
    """The scene in Mitsuba."""

    name = "mitsuba"

    def __init__(self, arguments, sampler):
        gltf = reference.Gltf(arguments.scene)
        builder = reference.Builder(gltf)
        if builder.camera is None:
            raise Refused("the scene has no camera")
        self.scene = mi.load_dict({"type": "scene"} | builder.entries)
        self.models = builder.models
        pose = np.eye(4)
        axes = builder.camera[:3, :3]
        pose[:3, :3] = axes / np.linalg.norm(axes, axis=0)
        pose[:3, 3] = builder.camera[:3, 3]
        # Mitsuba's camera looks along +Z with +X to the left.
        pose = pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
        side = arguments.side
        self.sensor = mi.load_dict(
            {
                "type": "perspective",
                "fov": 2 * arguments.half_angle,
                "to_world": mi.ScalarTransform4f(pose),
                "film": {
                    "type": "hdrfilm",
                    "width": side,
                    "height": side,
                    "rfilter": {"type": "box"},
                    "pixel_format": "rgb",
                    "component_format": "float32",
                },
                "sampler": {"type": sampler},
            }
        )
        self.integrator = mi.load_dict(
            {"type": "path", "max_depth": arguments.max_depth, "rr_depth": 5 if arguments.best else NEVER}
        )

    def render(self, spp, seed):
        """Seconds and the picture."""
        began = time.perf_counter()
        image = mi.render(self.scene, sensor=self.sensor, integrator=self.integrator, spp=spp, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        seconds = time.perf_counter() - began
        return seconds, np.array(image, dtype="f8")


class Stereolux:
    """The scene in stereolux, one process per picture."""

    name = "stereolux"

    def __init__(self, arguments):
        angle = arguments.half_angle
        self.command = [arguments.stereolux, "render", "--scene", arguments.scene, "--method", "path"]
        self.command += ["--reuse", "off", "--eyes", "left", "--size", f"{arguments.side}x{arguments.side}"]
        self.command += ["--fov", f"{-angle} {angle} {angle} {-angle}", "--set", f"path.max_depth={arguments.max_depth}"]
        # One picture of two eyes 0 m apart looks from the camera itself.
        self.command += ["--ipd", "0"]
        if not arguments.best:
            for setting in ("path.sampler=random", "path.russian_roulette=false", "path.light_candidates=1"):
                self.command += ["--set", setting]
        for setting in arguments.set:
            self.command += ["--set", setting]
        if arguments.adapter:
            self.command += ["--adapter", arguments.adapter]

    def render(self, spp, seed):
        with tempfile.TemporaryDirectory() as folder:
            command = self.command + ["--spp", str(spp), "--seed", str(seed), "--out", folder]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise Refused(f"{shlex.join(command)}: {done.stderr.strip()}")
            statistics_line = json.loads((Path(folder) / "stats.jsonl").read_text().splitlines()[-1])
            image = mi.Bitmap(str(Path(folder) / "frame_0000_left.exr"))
            pixels = np.array(image.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), dtype="f8")
        return statistics_line["gpu_ms"]["total"] / 1e3, pixels


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stereolux", default="target/release/stereolux", help="the program")
    parser.add_argument("--scene", default="assets/cornell.glb", help="glTF file with a camera")
    parser.add_argument("--side", type=int, default=256, help="pixels of an edge")
    parser.add_argument("--half-angle", type=float, default=19.65, help="half the field of view, degrees")
    parser.add_argument("--max-depth", type=int, default=12, help="segments from eye to light; 2 is direct light")
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 16], help="samples per pixel, 2 or more")
    parser.add_argument("--rounds", type=int, default=5, help="rounds that count")
    parser.add_argument("--warm-up", type=int, default=1, help="rounds before them")
    parser.add_argument("--best", action="store_true", help="each renderer with what serves it best")
    parser.add_argument("--error", type=float, nargs="+", default=[0.1, 0.01], help="relMSE to reach")
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--adapter", help="substring of the adapter's name")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting of stereolux")
    parser.add_argument("--out", help="JSON file for all figures")
    arguments = parser.parse_args()
    if min(arguments.spp) < 2 or arguments.rounds < 1:
        parser.error("--spp needs at least 2 (one sample looks through the pixel's centre), --rounds at least 1")
    return arguments


def main():
    global mi, dr
    arguments = parse_arguments()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(arguments.variant)
    reference.mi, reference.dr = mi, dr
    define_plugins(mi, dr)
    independent, stereolux = Mitsuba(arguments, "independent"), Stereolux(arguments)
    mitsuba = Mitsuba(arguments, "ldsampler") if arguments.best else independent
    per_batch = max(1, arguments.reference_spp // BATCHES)
    batches = np.array([independent.render(per_batch, 1000 + k)[1] for k in range(BATCHES)])
    truth = batches.mean(axis=0)
    own_variance = batches.var(axis=0, ddof=1) / BATCHES
    own_share = relative(own_variance, truth)
    rows, means = [], {mitsuba.name: [], stereolux.name: []}
    for turn in range(arguments.warm_up + arguments.rounds):
        for spp in arguments.spp:
            order = [stereolux, mitsuba] if turn % 2 == 0 else [mitsuba, stereolux]
            for renderer in order:
                seconds, image = renderer.render(spp, 1 + turn)
                if turn < arguments.warm_up:
                    continue
                error = relative_mse(image, truth) - own_share
                means[renderer.name].append(float(image.mean()))
                rows.append({"of": renderer.name, "spp": spp, "seconds": seconds, "rel_mse": error, "round": turn})
    pixels = arguments.side**2
    print(f"{arguments.scene}, {arguments.side}x{arguments.side}, depth {arguments.max_depth}, {arguments.rounds} rounds")
    print(f"Mitsuba {mi.__version__}, {arguments.variant}, reference {per_batch * BATCHES} spp (its share {own_share:.2g})")
    heads = [f"s to relMSE {error:g}" for error in arguments.error]
    print("| renderer | spp | seconds | samples per second | relMSE | relMSE x spp |", " | ".join(heads), "|")
    print("|---" * (6 + len(heads)) + "|")
    for spp in arguments.spp:
        ratios = {}
        for renderer in (stereolux, mitsuba):
            own = [row for row in rows if row["of"] == renderer.name and row["spp"] == spp]
            seconds = [row["seconds"] for row in own]
            errors = [row["rel_mse"] for row in own]
            ratios[renderer.name] = [row["seconds"] * row["rel_mse"] for row in own]
            reach = [quartiles([time / error for time in ratios[renderer.name]]) for error in arguments.error]
            cells = [renderer.name, str(spp), quartiles(seconds), quartiles([pixels * spp / s for s in seconds])]
            cells += [quartiles(errors), f"{spp * statistics.median(errors):.4g}", *reach]
            print("|", " | ".join(cells), "|")
        pairs = [a / b for a, b in zip(ratios[stereolux.name], ratios[mitsuba.name], strict=True)]
        print(f"| stereolux / Mitsuba, time to equal error | {spp} | {quartiles(pairs)} |" + " |" * (3 + len(heads)))
    ratio = statistics.mean(means[stereolux.name]) / statistics.mean(means[mitsuba.name])
    print(f"mean of stereolux over Mitsuba's: {ratio:.4f}")
    if arguments.out:
        record = {"arguments": vars(arguments), "mitsuba": mi.__version__, "models": mitsuba.models}
        record |= {"reference_share": own_share, "mean_ratio": ratio, "rows": rows}
        Path(arguments.out).write_text(json.dumps(record, indent=1) + "\n")
    if abs(ratio - 1.0) > 0.01:
        raise Refused(f"the pictures differ: means by a factor of {ratio:.4f}")
    if len(arguments.spp) > 1:
        for renderer in (stereolux, mitsuba):
            by_spp = [
                spp * statistics.median(r["rel_mse"] for r in rows if r["of"] == renderer.name and r["spp"] == spp)
                for spp in (min(arguments.spp), max(arguments.spp))
            ]
            if not math.isclose(by_spp[0], by_spp[1], rel_tol=0.5):
                raise Refused(f"{renderer.name}: the error does not fall as 1 / samples: {by_spp}")


if __name__ == "__main__":
    try:
        main()
    except (Refused, OSError) as error:
        sys.exit(f"speed_mitsuba.py: {error}")
