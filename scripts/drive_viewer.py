#!/usr/bin/env python3
"""Drives the viewer's window as a person would and prints when each action is first answered on the screen.

    scripts/drive_viewer.py target/release/stereolux MODEL.gltf --out out/driven
    scripts/drive_viewer.py target/release/stereolux --views --out out/driven

On a virtual screen of 1280x800 over builtin:gallery: select, change a material, undo, redo, orbit, walk, change the view,
save, open MODEL by the path field, quit. Needs Xvfb, xdotool and Pillow. An answer is a change of more than 0.2 % of the
watched part's pixels (5 % where the picture is asked for), so that a cursor or a text field does not count as one; the
time includes xdotool's start, some 10 ms. With --views: how long each view, chosen in the menu, is awaited until a picture of
its own stands: one that is neither the last view's nor that one dimmed. Writes the screens as PNG into --out; look at them.
"""
import argparse
import atexit
import os
import pathlib
import signal
import statistics
import struct
import subprocess
import time

from PIL import Image

WIDTH, HEIGHT = 1280, 800
DISPLAY = ":77"
# Left, top, right, bottom, pixels.
SCREEN = (0, 0, 1280, 800)
PICTURES = (212, 52, 908, 620)
INSPECTOR = (912, 80, 1275, 620)
# Of the pictures, what the menu of views leaves free.
BESIDE_MENU = (560, 80, 908, 620)
# Rows of the menu of views: the picture comes first, the error last.
VIEWS = ("picture", "direct", "indirect", "caustic", "albedo", "normal", "depth", "instance", "photon density", "photon dots",
         "grid occupancy", "bvh steps", "motion", "variance", "provenance", "error")
# What the last view's picture is multiplied by while another is awaited: picture.rs, `show_notes`.
DIMMED = 55 / 255
PATIENCE_S = 30


class Desk:
    """A virtual screen with the viewer's window on it."""

    def __init__(self, program, out):
        self.out = out
        out.mkdir(parents=True, exist_ok=True)
        frames = out / "screen"
        frames.mkdir(exist_ok=True)
        self.start_process(["Xvfb", DISPLAY, "-screen", "0", f"{WIDTH}x{HEIGHT}x24", "-fbdir", frames], os.environ)
        time.sleep(2)
        self.env = dict(os.environ, DISPLAY=DISPLAY, WINIT_X11_SCALE_FACTOR="1", XDG_CONFIG_HOME=str(out / "config"))
        self.app = self.start_process([program, "view", "--scene", "builtin:gallery", "--out", out / "saved"], self.env)
        self.screen = open(frames / "Xvfb_screen0", "rb", buffering=0)
        head = struct.unpack(">25I", self.screen.read(100))
        self.start, self.row = head[0] + 12 * head[19], head[12]
        self.times_ms = []
        time.sleep(8)
        # There is no window manager that would give it the keyboard.
        found = subprocess.run(["xdotool", "search", "--name", "stereolux"], env=self.env, capture_output=True, check=True)
        self.xdotool("windowfocus", found.stdout.split()[-1].decode())
        time.sleep(1)

    @staticmethod
    def start_process(words, env):
        process = subprocess.Popen(words, env=env)
        # Nothing is left running, whatever goes wrong.
        atexit.register(process.terminate)
        return process

    def xdotool(self, *words):
        subprocess.run(["xdotool", *map(str, words)], env=self.env, check=True)

    def pixels(self, part):
        left, top, right, bottom = part
        self.screen.seek(self.start)
        screen = self.screen.read(self.row * HEIGHT)
        return b"".join(screen[y * self.row + 4 * left:y * self.row + 4 * right] for y in range(top, bottom))

    def drag(self, start, end, button):
        self.xdotool("mousemove", *start, "mousedown", button)
        for step in range(1, 5):
            self.xdotool("mousemove", *(a + (b - a) * step // 4 for a, b in zip(start, end)))
            time.sleep(0.02)

    def act(self, name, act, part=PICTURES, share=0.002, after=lambda: None, is_answer=lambda now, before: now != before):
        before = self.pixels(part)
        began = time.monotonic()
        act()
        while True:
            now = self.pixels(part)
            differing = sum(is_answer(now[at:at + 3], before[at:at + 3]) for at in range(0, len(now), 64))
            elapsed_s = time.monotonic() - began
            if differing > share * len(now) / 64:
                break
            if elapsed_s > PATIENCE_S:
                self.save_png("no_answer")
                raise SystemExit(f"{name}: no answer within {PATIENCE_S} s")
            time.sleep(0.005)
        self.times_ms.append(1e3 * elapsed_s)
        print(f"{name:34} {1e3 * elapsed_s:5.0f} ms", flush=True)
        after()
        time.sleep(4)
        self.save_png(name.replace(" ", "_"))

    def save_png(self, name):
        image = Image.frombuffer("RGB", (WIDTH, HEIGHT), self.pixels(SCREEN), "raw", "BGRX", 0, 1)
        image.save(self.out / f"{name}.png")

    def close(self):
        """Sends what `kill` sends, and gives the milliseconds until it has ended."""
        began = time.monotonic()
        self.app.send_signal(signal.SIGTERM)
        status = self.app.wait(PATIENCE_S)
        if status != 0:
            raise SystemExit(f"it ended with status {status}")
        return 1e3 * (time.monotonic() - began)


def is_another_picture(now, before):
    """Whether a pixel shows neither the last view nor that one dimmed, but for what refining changes."""
    far = lambda factor: any(abs(a - factor * b) > 16 for a, b in zip(now, before))
    return far(1) and far(DIMMED)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path, help="the stereolux program")
    parser.add_argument("model", type=pathlib.Path, nargs="?", help="what is opened, .gltf or .glb")
    parser.add_argument("--views", action="store_true", help="measure the views instead; needs no model")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/driven"))
    options = parser.parse_args()
    if not options.views and options.model is None:
        parser.error("a model is needed, or --views")
    desk = Desk(options.program.resolve(), options.out.resolve())
    key = lambda name: lambda: desk.xdotool("key", name)
    click = lambda: desk.xdotool("click", 1)

    def point(x, y):
        desk.xdotool("mousemove", x, y)
        time.sleep(0.3)

    def choose_view(row):
        point(400, 12)
        click()
        time.sleep(1)
        point(400, 16 + 23 * row)

    def sum_up(*more):
        print("; ".join([f"median {statistics.median(desk.times_ms):.0f} ms, worst {max(desk.times_ms):.0f} ms", *more]))

    if options.views:
        for row in [*range(1, len(VIEWS)), 0]:
            choose_view(row + 1)
            desk.act(f"view {VIEWS[row]}", click, BESIDE_MENU, 0.2, is_answer=is_another_picture)
        desk.close()
        return sum_up()
    point(389, 341)
    desk.act("select the vase", click, INSPECTOR)
    desk.act("change its colour", lambda: desk.drag((1124, 276), (1190, 276), 1), after=lambda: desk.xdotool("mouseup", 1))
    desk.act("undo", key("ctrl+z"))
    desk.act("redo", key("ctrl+shift+z"))
    desk.act("orbit", lambda: desk.drag((389, 400), (340, 400), 2), share=0.05, after=lambda: desk.xdotool("mouseup", 2))
    desk.act("walk", lambda: desk.xdotool("keydown", "w"), share=0.05, after=lambda: desk.xdotool("keyup", "w"))
    choose_view(6)
    desk.act("change the view", click, share=0.05)
    choose_view(1)
    desk.act("change it back", click, share=0.05)
    desk.act("save", key("ctrl+s"), SCREEN)
    desk.act("ask what to open", key("ctrl+o"), SCREEN)
    desk.xdotool("key", "ctrl+a")
    desk.xdotool("type", "--delay", 5, options.model.resolve())
    time.sleep(1)
    desk.act("open the model", key("Return"), SCREEN)
    time.sleep(8)
    desk.save_png("opened")
    quit_ms = desk.close()
    sum_up(f"ended {quit_ms:.0f} ms after SIGTERM")


if __name__ == "__main__":
    main()
