#!/usr/bin/env python3
"""Measures the frames of drags in the window, on a screen of its own: docs/results/data/drags.csv.

Each scene is opened once for each thing that is dragged, and a mouse drags it to and fro. The program itself reports for how
long its window's thread was busy with each frame, what the frames made of the device, and the device time of the pictures.

usage: tests/frames-of-drags.py VGS SCENE [SCENE...] > drags.csv
       VGS is the program, by its path (a release build); SCENE is a file of splats
Needs Xvfb and xdotool (`tools/setup window`) and a machine that does nothing else.
"""

import csv
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time

TOOLS = pathlib.Path(__file__).resolve().parent.parent / "tools"
SIZE = "1280x720"
# What is dragged: a key before, the button of the mouse.
DRAGS = {"turn": (None, "1"), "window and level": (None, "3"), "turn with a plane": ("c", "1"), "plane": ("c", "2")}
DRAGGED = 100


class Viewer:
    def __init__(self, program, scene, folder):
        settings = folder / "config/vgs"
        settings.mkdir(parents=True)
        (settings / "view.toml").write_text("notice_seen = true\n")
        environment = {**os.environ, "XDG_CONFIG_HOME": str(folder / "config"), "DBUS_SESSION_BUS_ADDRESS": "unix:path=/nowhere"}
        environment.pop("WAYLAND_DISPLAY", None)
        self.log, self.folder = [], folder
        arguments = ["view", "-vv", scene, "--tf", "CT-Bone", "--report", str(folder / "report.json")]
        self.child = subprocess.Popen([TOOLS / "run", program, *arguments], env=environment, stderr=subprocess.PIPE, text=True)
        threading.Thread(target=lambda: self.log.extend(self.child.stderr), daemon=True).start()
        self.wait("a picture", lambda: any("picture rendered in full" in line for line in self.log))
        self.settle()
        self.hand("search", "--name", "vgs", "windowfocus")

    def hand(self, *arguments):
        subprocess.run([TOOLS / "run", "xdotool", *arguments], check=True, stdout=subprocess.DEVNULL)

    def wait(self, what, holds):
        until = time.monotonic() + 120
        while not holds():
            if self.child.poll() is not None or time.monotonic() > until:
                sys.exit(f"no {what}:\n" + "".join(self.log))
            time.sleep(0.02)

    def settle(self):
        lines = -1
        while lines != len(self.log):
            lines = len(self.log)
            time.sleep(1)

    def wake(self):
        """Moves the mouse, as a hand does before it presses. A virtual machine also takes 50 ms and more for the memory of a program
        that has rested for a second or two, whatever the program does with it."""
        moves = [["mousemove", str(430 + step % 2), "350", "sleep", "0.03"] for step in range(30)]
        self.hand(*sum(moves, []))

    def end(self):
        for step in [("key", "ctrl+s"), ("key", "ctrl+a"), ("type", "--delay", "20", str(self.folder / "kept.toml"))]:
            self.wake()
            self.hand(*step)
            self.settle()
        self.wake()
        self.hand("key", "Return")
        self.wait("session file", (self.folder / "kept.toml").is_file)
        self.settle()
        self.hand("key", "ctrl+q")
        if self.child.wait(60) != 0:
            sys.exit("".join(self.log))
        return json.loads((self.folder / "report.json").read_text())


def measure(program, scene, key, button):
    with tempfile.TemporaryDirectory() as folder:
        viewer = Viewer(program, scene, pathlib.Path(folder))
        if key:
            viewer.hand("mousemove", "430", "350", "key", key)
            viewer.settle()
        viewer.wake()
        moves = ["mousedown", button]
        for step in range(DRAGGED):
            across = 2 * min(step, DRAGGED - step)
            moves += ["mousemove", str(430 + across), str(350 + across // 4), "sleep", "0.03"]
        viewer.hand(*moves, "mouseup", button)
        viewer.settle()
        return viewer.end()


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    program, scenes = sys.argv[1], sys.argv[2:]
    if "VGS_SCREEN" not in os.environ:
        environment = {**os.environ, "VGS_SCREEN_SIZE": SIZE}
        sys.exit(subprocess.run([TOOLS / "xvfb", sys.executable, *sys.argv], env=environment).returncode)
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["scene", "dragged", "frames", "median ms", "99 % ms", "greatest ms", "above 50 ms", "pictures", "allocating",
                  "waiting"])
    for scene in scenes:
        for dragged, (key, button) in DRAGS.items():
            report = measure(program, scene, key, button)
            drags = report["drags"]
            busy = sorted(drags["busy_ms"])
            times = [statistics.median(busy), busy[len(busy) * 99 // 100], busy[-1]]
            out.writerow([pathlib.Path(scene).stem, dragged, len(busy), *(f"{ms:.1f}" for ms in times),
                          sum(ms > 50 for ms in busy), drags["frames"], drags["allocating"], drags["waiting"]])
            sys.stdout.flush()


main()
