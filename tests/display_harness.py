"""What tests of display processes share: the processes, the runs that send to them, and what both leave."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import png
from xxh64 import xxh64

HPR = os.path.abspath(sys.argv[1])
SCENE = "gen:gallery"
LIGHT = ["--passes", "none"]
WALL = "2x1@64x48"
TWO_HOSTS = """
hpr_wall = 1
nodes = [ { id = "a", host = "left" }, { id = "b", host = "right" } ]
windows = [ { id = "w0", node = "a" }, { id = "w1", node = "b" } ]
[[surfaces]]
id = "wall"
[surfaces.grid]
columns = 2
rows = 1
tile_pixels = [64, 48]
tile_size_m = [0.64, 0.48]
windows = ["w0", "w1"]
"""
failures = []


def complain(case, message):
    failures.append(case)
    print(f"{case}: {message}")


def environment(folder):
    return {**os.environ, "XDG_RUNTIME_DIR": str(folder)}


def wait_until(happens, seconds):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if happens():
            return True
        time.sleep(0.01)
    return False


class Display:
    """A display process that is up once this is made, and gone afterwards."""

    def __init__(self, folder, wall, host, *options):
        self.folder = folder / f"shown-{host}"
        self.log = open(folder / f"display-{host}.log", "a+", encoding="utf-8")
        begin = self.log.tell()
        self.process = subprocess.Popen([HPR, "display", "--wall", wall, "--host", host, "-o", str(self.folder), "--force", *options],
                                        cwd=folder, env=environment(folder), stderr=self.log)
        up = lambda: "listening on" in pathlib.Path(self.log.name).read_text(encoding="utf-8")[begin:]
        if not wait_until(lambda: up() or self.process.poll() is not None, 20) or self.process.poll() is not None:
            complain("display", f"did not start: {self.said()}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
        self.process.wait(timeout=20)
        self.log.close()

    def kill(self):
        self.process.kill()
        self.process.wait(timeout=20)

    def said(self):
        return pathlib.Path(self.log.name).read_text(encoding="utf-8")

    def status(self):
        return json.loads((self.folder / "display.json").read_text())

    def frame(self):
        """Of its first screen; -1 before the first."""
        if not (self.folder / "display.json").exists():
            return -1
        frame = self.status()["screens"][0]["frame"]
        return -1 if frame is None else frame

    def picture(self, screen):
        return (self.folder / f"{screen}.png").read_bytes()


def run(folder, wall, *options, frames=3, env=None, timeout=60, scene=SCENE):
    return subprocess.run([HPR, "wall", "run", wall, scene, *LIGHT, "--frames", str(frames), *options], cwd=folder,
                          env={**environment(folder), **(env or {})}, capture_output=True, text=True, timeout=timeout, check=False)


def start(folder, wall, frames, *options):
    return subprocess.Popen([HPR, "wall", "run", wall, SCENE, *LIGHT, "--frames", str(frames), "--display", "remote", "-o", "out", "--force",
                             "--path", "path", *options],
                            cwd=folder, env=environment(folder), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def manifest(folder, name="out"):
    return json.loads((folder / name / "manifest.json").read_text())


def states(frames, screen):
    return [s["state"] for f in frames for s in f["screens"] if s["id"] == screen]


def write_path(folder):
    (folder / "path").write_text("eye -4,1.7,4 at 0,1.6,-2\neye 4,1.7,3 at 2,1.5,-2\n")


def hash_of(picture):
    """Of a PNG's bytes, what a manifest says of its pixels."""
    return xxh64(png.decode(picture)[2])
