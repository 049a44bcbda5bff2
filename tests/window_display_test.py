#!/usr/bin/env python3
"""Windows show the pixels the file display writes, follow the mouse, and end the run when they are closed.

usage: window_display_test.py HPR [PICTURE]

Without Xvfb it leaves with 77 (skipped). PICTURE, a .png, is written with what the desktop shows. Prints what differs
and leaves with 1.
"""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

import png
import x11

HPR = os.path.abspath(sys.argv[1])
SCENE = ["gen:gallery", "--passes", "none"]
STILL = ["--display", "window", "--spp", "1", "--target-ms", "60000"]
GAP = bytes((32, 32, 36, 255))
# One window with two screens, the second on a panel that is mounted turned.
TURNED = """hpr_wall = 1
windows = [{ id = "both", rect = [30, 20, 200, 160] }]
[[surfaces]]
id = "wall"
screens = [
  { id = "left", pixels = [120, 160], window = "both", viewport = [0, 0, 120, 160], \
corners_m = { ll = [0, 0, 0], lr = [0.12, 0, 0], ul = [0, 0.16, 0] } },
  { id = "right", pixels = [160, 80], rotate = 90, window = "both", viewport = [120, 0, 80, 160], \
corners_m = { ll = [0.12, 0, 0], lr = [0.28, 0, 0], ul = [0.12, 0.08, 0] } },
]
"""
# Each rank has a screen of its own.
TWO_RANKS = """hpr_wall = 1
windows = [{ id = "a", rank = 0 }, { id = "b", rank = 1 }]
[[surfaces]]
id = "wall"
screens = [
  { id = "left", pixels = [64, 64], window = "a", corners_m = { ll = [0, 0, 0], lr = [0.1, 0, 0], ul = [0, 0.1, 0] } },
  { id = "right", pixels = [64, 64], window = "b", corners_m = { ll = [0.1, 0, 0], lr = [0.2, 0, 0], ul = [0.1, 0.1, 0] } },
]
"""
failures = []


def complain(message):
    failures.append(message)
    print(message)


def environment(display):
    mine = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return {**mine, "DISPLAY": display} if display else mine


def draw_files(folder, wall):
    """What windows show once the camera rests: frame 1, after which a single look per pixel leaves nothing to refine."""
    subprocess.run([HPR, "wall", "run", wall, *SCENE, "--frames", "2", "--display", "file", "-o", "files", "--force"],
                   cwd=folder, check=True, capture_output=True, timeout=120)
    return folder / "files"


class Run:
    """An open-ended run in windows."""

    def __init__(self, folder, display, *arguments):
        self.process = subprocess.Popen([HPR, *arguments], cwd=folder, env=environment(display), stderr=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)

    def ends(self, name, code=0, seconds=30):
        try:
            said = self.process.communicate(timeout=seconds)[1]
        except subprocess.TimeoutExpired:
            self.process.kill()
            said = self.process.communicate()[1] + f"\n(killed after {seconds} s)"
        if self.process.returncode != code:
            complain(f"{name}: left with {self.process.returncode} instead of {code}: {said[-900:]}")
        return said


def wait_until(what, test, run, seconds=60):
    end = time.monotonic() + seconds
    while time.monotonic() < end and run.process.poll() is None:
        if test():
            return True
        time.sleep(0.2)
    complain(f"not within {seconds} s: {what}")
    return False


def differing(desktop, wall):
    """How many pixels of the assembled wall that are no gap the desktop shows otherwise."""
    width, _, shown = desktop
    columns, rows, wanted = wall
    count = 0
    for y in range(rows):
        for x in range(columns):
            pixel = wanted[4 * (y * columns + x):][:4]
            if pixel != GAP and pixel != shown[4 * (y * width + x):][:4]:
                count += 1
    return count


def cut(desktop, x, y, width, height):
    return [desktop[2][4 * ((y + j) * desktop[0] + x):][:4 * width] for j in range(height)]


def four_windows(folder, display, client, picture):
    wall = png.read(draw_files(folder, "2x2@160x120") / "wall.png")
    for ranks in ("1", "2"):
        run = Run(folder, display, "wall", "run", "2x2@160x120", *SCENE, *STILL, "--ranks", ranks)
        name = f"{ranks} ranks"
        if wait_until(f"{name}: the windows show the file display's pixels",
                      lambda: differing(client.picture(), wall) == 0, run):
            before = client.picture()
            if picture and ranks == "1":
                png.write(pathlib.Path(picture), *before)
            client.drag((80, 60), (110, 60))
            wait_until(f"{name}: dragging turns the scene", lambda: differing(client.picture(), wall) > 1000, run)
        if ranks == "1":
            client.press(x11.ESCAPE)
        else:
            run.process.send_signal(signal.SIGINT)
        run.ends(f"{name}, ended by {'Escape' if ranks == '1' else 'SIGINT'}")


def turned(folder, display, client):
    (folder / "turned.toml").write_text(TURNED)
    files = draw_files(folder, "turned.toml")
    left, right = png.read(files / "left.png"), png.read(files / "right.panel.png")
    # The files hold what panels are sent: the second one turned.
    if right[:2] != (80, 160):
        complain(f"the turned screen's file has {right[0]}x{right[1]} pixels")
    rows, turned_rows = [[p[2][4 * p[0] * y:][:4 * p[0]] for y in range(p[1])] for p in (left, right)]
    run = Run(folder, display, "wall", "run", "turned.toml", *SCENE, *STILL)

    def shows_both():
        desktop = client.picture()
        return cut(desktop, 30, 20, 120, 160) == rows and cut(desktop, 150, 20, 80, 160) == turned_rows

    wait_until("a window with two screens, one turned", shows_both, run)
    run.process.send_signal(signal.SIGTERM)
    run.ends("one window, ended by SIGTERM")


def server_lost(folder):
    """An X server that goes away ends the run, with a word."""
    with x11.Xvfb(200, 200) as server:
        client = x11.Client(server.number)
        empty = client.picture()
        run = Run(folder, server.name, "wall", "run", "1x1@64x64", *SCENE, *STILL)
        wait_until("a window before its X server goes", lambda: client.picture() != empty, run)
        server.process.kill()
        said = run.ends("its X server was killed", 7)
        if f"hpr: error: the X server '{server.name}' is gone" not in said:
            complain(f"its X server was killed: {said!r}")


class Frozen:
    """A run whose X server stands still; it takes half a minute to give up."""

    def __init__(self, folder, server):
        client = x11.Client(server.number)
        empty = client.picture()
        self.server = server
        self.run = Run(folder, server.name, "wall", "run", "1x1@64x64", *SCENE, "--display", "window", "--frames", "1000000")
        wait_until("a window before its X server freezes", lambda: client.picture() != empty, self.run)
        server.process.send_signal(signal.SIGSTOP)

    def ends(self):
        said = self.run.ends("its X server stands still", 7, 60)
        self.server.process.send_signal(signal.SIGCONT)
        if "the desktop shows no frames any more" not in said:
            complain(f"its X server stands still: {said!r}")


def ranks_beside_a_stopped_server(folder):
    """A job without windows asks nothing of a desktop, which may stand still."""
    with x11.Xvfb(64, 64, first=1) as server:
        server.process.send_signal(signal.SIGSTOP)
        try:
            subprocess.run([HPR, "wall", "run", "1x1@32x32", *SCENE, "--display", "none", "--ranks", "2"], cwd=folder,
                           env=environment(None), check=True, capture_output=True, timeout=20)
        except (subprocess.TimeoutExpired, subprocess.CalledProcessError) as error:
            complain(f"two ranks beside an X server that stands still: {error} {error.stderr}")
        finally:
            server.process.send_signal(signal.SIGCONT)


def view_with_two_minds(folder, server):
    """Where one of two ranks has a desktop both do as the first one can: a page, or windows which the second cannot open."""
    (folder / "two.toml").write_text(TWO_RANKS)
    view = [HPR, "view", *SCENE, "--wall", "two.toml", "--frames", "2", "--hang-timeout", "20"]
    with_desktop, without = ["-n", "1", "env", f"DISPLAY={server.name}", *view], ["-n", "1", "env", "-u", "DISPLAY", *view]
    for name, ranks, code, words in (("second", [*without, ":", *with_desktop], 0, "http://127.0.0.1:"),
                                     ("first", [*with_desktop, ":", *without], 5, "hpr: error: there is no desktop for windows")):
        result = subprocess.run(["mpiexec", *ranks], cwd=folder, env=environment(None), capture_output=True, text=True, timeout=120,
                                check=False)
        if result.returncode != code or words not in result.stdout + result.stderr:
            complain(f"view where the {name} rank alone has a desktop: left with {result.returncode}: {result.stdout} "
                     f"{result.stderr[-900:]}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-window-") as scratch:
        folder = pathlib.Path(scratch)
        Run(folder, None, "wall", "run", "1x1@32x32", *SCENE, "--display", "window").ends("without a desktop", 5)
        if not x11.Xvfb.available:
            return 1 if failures else 77
        with x11.Xvfb(500, 400) as server, x11.Xvfb(200, 200) as standing:
            frozen = Frozen(folder, standing)
            # The server must have somebody connected all the time, or it resets.
            client = x11.Client(server.number)
            four_windows(folder, server.name, client, sys.argv[2] if len(sys.argv) > 2 else None)
            turned(folder, server.name, client)
            Run(folder, server.name, "wall", "run", "1x1@32x32", *SCENE, "--display", "window", "--frames", "2").ends("two frames")
            view_with_two_minds(folder, server)
            server_lost(folder)
            ranks_beside_a_stopped_server(folder)
            frozen.ends()
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
