#!/usr/bin/env python3
"""Redraws the plots of a report from its rows.csv with matplotlib: scripts/redraw.py out/pareto/rows.csv --out plots

Writes PLOT_SCENE.svg, and a file for each radius of `tables` and each series of `scaling`. --plot names the ones that are
wanted, --format pdf or png another format. Bars are quartiles of times and ratios, and one standard error of errors. Change PLOTS for
others: suite, x, y, what tells series apart, what tells files apart, whether lines join the dots, logarithmic axes.
"""
import argparse
import collections
import csv
import itertools
import pathlib
import re

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MS = "timing.ms.{}.median"
FRAME = ("time per frame, photons traced anew, milliseconds", MS.format("frame"))
PHOTONS = ("photon paths per frame", "factors.photons")
IPD = ("distance between the eyes, millimetres", "factors.ipd_mm")
KIND = ["method", "direct", "rate", "light_candidates"]
Plot = collections.namedtuple("Plot", "suite x y series files line log keep")
PLOTS = {
    "pareto": Plot("pareto", FRAME, ("relative MSE", "errors.left.rel_mse.value"), KIND, [], False, True,
                   lambda row: row["factors.method"] != "anchor"),
    "pareto_flip": Plot("pareto", FRAME, ("FLIP", "errors.left.flip.value"), KIND, [], False, True,
                        lambda row: row["factors.method"] != "anchor"),
    **{name: Plot("pareto", PHOTONS, (words, f"errors.left.bias_variance.{column}"), ["radius_m", *KIND], [], True, True,
                  lambda row: (row["factors.method"], row["factors.kernel"], row["factors.direct"], row["factors.spp"])
                  == ("photon", "constant", "nee", "1"))
       for name, words, column in [("bias", "squared bias of a frame, over the reference's square", "bias_squared"),
                                   ("variance", "variance of a frame, over the reference's square", "variance")]},
    "stereo": Plot("stereo", IPD, ("time of two separate eyes over both eyes'", "1/timing.ratio.eyes.median"), ["reuse"], [],
                   True, False, lambda row: row["factors.reuse"] != "off" and ", ipd " in row["group"]),
    "stereo_reused": Plot("stereo", IPD, ("share of the right eye's pixels that were reused", "stereo.reuse_fraction.median"),
                          ["reuse"], [], True, False,
                          lambda row: row["factors.reuse"] != "off" and ", ipd " in row["group"]),
    "fill": Plot("stereo", ("pixels of the right eye that were filled", "stereo.filled"),
                 ("time of the passes that fill, milliseconds", MS.format("fill")), ["reuse"], [], False, False,
                 lambda row: True),
    **{f"scaling_{cost}": Plot("scaling", ("", "factors.{series}"), (f"time of {words}, milliseconds", MS.format(cost)),
                               ["variant"], ["series"], True, True, lambda row: True)
       for cost, words in [("left", "an eye"), ("photons", "the photon map"), ("host_update", "the host's scene update")]},
    "tables": Plot("tables", PHOTONS, ("time of all passes of an eye, milliseconds", MS.format("left")), ["way"], ["radius"],
                   True, True, lambda row: float(row["factors.table"]) < 5),
}


def value(row, column):
    """A figure and its bar's ends; None where the row has none."""
    inverse = column.startswith("1/")
    column = column.removeprefix("1/")
    if not row.get(column):
        return None
    middle = float(row[column])
    low = high = middle
    base = column.rsplit(".", 1)[0]
    error = row.get(f"{base}.standard_error") if column.endswith(".value") else row.get(f"{column}_se")
    if column.endswith(".median"):
        low, high = (float(row[f"{base}.{end}_quartile"]) for end in ("lower", "upper"))
    elif error:
        low, high = middle - float(error), middle + float(error)
    return (1 / middle, 1 / high, 1 / low) if inverse else (middle, low, high)


def factor(row, name):
    if name == "variant":
        # The photon counts are variants of one group.
        return row["variant"] if row["factors.series"] != "photons" else "photon"
    return row.get(f"factors.{name}", "")


def grouped(rows, key):
    groups = collections.defaultdict(list)
    for row in rows:
        groups[key(row)].append(row)
    return sorted(groups.items())


def front(points):
    """Those that no other is both faster and better than."""
    least, kept = float("inf"), []
    for x, y in sorted(points):
        if y < least:
            least = y
            kept.append((x, y))
    return kept


def draw(name, plot, rows, label, path):
    figure, axes = plt.subplots(figsize=(9, 6), layout="constrained")
    drawn = []
    for series, members in grouped(rows, lambda row: tuple(factor(row, factor_name) for factor_name in plot.series)):
        x_column = plot.x[1].format(series=factor(members[0], "series"))
        pairs = sorted((x, y) for x, y in ((value(row, x_column), value(row, plot.y[1])) for row in members) if x and y)
        pairs = [(x, y) for x, y in pairs if not plot.log or (x[0] > 0 and y[0] > 0)]
        if not pairs:
            continue
        bars = [[[p[axis][0] - p[axis][1] for p in pairs], [p[axis][2] - p[axis][0] for p in pairs]] for axis in (0, 1)]
        # Paths of one kind differ in their samples alone.
        is_line = plot.line or series[0] == "path"
        axes.errorbar([x[0] for x, _ in pairs], [y[0] for _, y in pairs], xerr=bars[0], yerr=bars[1], fmt="o-" if is_line else "o",
                      elinewidth=0.8, label=", ".join(word for word in series if word))
        drawn += [(x[0], y[0]) for x, y in pairs]
    if not drawn:
        plt.close(figure)
        return
    if name.startswith("pareto"):
        axes.step(*zip(*front(drawn)), where="post", color="black", linewidth=0.8, label="Pareto front")
    if plot.log:
        axes.set(xscale="log", yscale="log")
    else:
        axes.set(xlim=(0, None), ylim=(0, None))
    axes.set(xlabel=plot.x[0] or factor(rows[0], "series").replace("_", " "), ylabel=plot.y[0], title=label)
    axes.legend(fontsize="small")
    figure.savefig(path)
    plt.close(figure)
    print(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("redrawn"))
    parser.add_argument("--plot", action="append", choices=PLOTS)
    parser.add_argument("--format", default="svg")
    options = parser.parse_args()
    with options.rows.open(newline="") as file:
        rows = list(csv.DictReader(file))
    options.out.mkdir(parents=True, exist_ok=True)
    for name in options.plot or PLOTS:
        plot = PLOTS[name]
        members = [row for row in rows if row["suite"] == plot.suite]
        members = [row for row in members if plot.keep(row)]
        def file_of(row):
            scene = "generated" if row["scene"].startswith("generated:") else row["scene"]
            return (scene, *(factor(row, word) for word in plot.files))
        stems = set()
        for key, of_file in grouped(members, file_of):
            stem = re.sub(r"[^A-Za-z0-9]", "_", "_".join([key[0].removeprefix("builtin:").split("/")[-1], *key[1:]]))
            kind = " (software adapter)" if of_file[0]["machine.software_adapter"] == "true" else ""
            label = f"{', '.join(word for word in key)}, {of_file[0]['machine.adapter']}{kind}"
            # Scenes of one name in two folders.
            numbered = (f"{stem}_{n}" if n > 1 else stem for n in itertools.count(1))
            stem = next(name for name in numbered if name not in stems)
            stems.add(stem)
            draw(name, plot, of_file, label, options.out / f"{name}_{stem}.{options.format}")


main()
