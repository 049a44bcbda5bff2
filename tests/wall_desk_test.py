#!/usr/bin/env python3
"""What stands beside a wall's run: the plan coloured by what was measured, patterns that count, the status line.

usage: wall_desk_test.py HPR
"""

import json
import os
import pathlib
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import time

import png
from program import HPR, expect, failures, run

LIGHT = ["gen:cornell", "--passes", "none"]
TURNED = """
hpr_wall = 1
[[surfaces]]
id = "wall"
[surfaces.grid]
columns = 2
rows = 1
tile_pixels = [320, 200]
tile_size_m = [0.64, 0.4]
gap_m = [0.01, 0.01]
rotate = 90
mirror = "horizontal"
"""


def check_heat(folder):
    ran = run(folder, "wall", "run", "3x2@320x240", *LIGHT, "--frames", "2", "-o", "out", "--ranks", "2", "--keep-frames")
    expect(ran.returncode == 0, ran.stderr)
    for frame in json.loads((folder / "out" / "manifest.json").read_text())["frames"]:
        sizes = [cost["bytes"] for cost in frame["costs"]]
        kept = folder / "out" / f"frame-{frame['frame']:06}"
        files = [(kept / f"{screen['id']}.png").stat().st_size for screen in frame["costs"]]
        expect(sizes == files, f"bytes of the screens: {sizes}, of the files: {files}")
        expect(all(cost["ms"] > 0 and cost["rank"] in (0, 1) for cost in frame["costs"]), f"{frame['costs']}")
        expect(frame["slowest"]["rank"] in (0, 1) and frame["slowest"]["pass_ms"] <= frame["slowest"]["ms"], f"{frame['slowest']}")
    drawn = run(folder, "wall", "plan", "3x2@320x240", "-o", "heat.svg", "--heat", "out/manifest.json", "--by", "bytes")
    expect(drawn.returncode == 0, drawn.stderr)
    svg = (folder / "heat.svg").read_text()
    expect("mean size of a picture" in svg and "2 frames" in svg and svg.count(" KiB<") >= 8, "the plan has no sizes")
    picture = run(folder, "wall", "plan", "3x2@320x240", "-o", "heat.png", "--heat", "out")
    expect(picture.returncode == 0 and (folder / "heat.png").stat().st_size > 1000, picture.stderr)
    for arguments, code, words in (
            (["2x2@64x48", "--heat", "out/manifest.json"], 3, "of another wall"),
            (["3x2@320x240", "--heat", "out/manifest.json", "--by", "byte"], 2, "did you mean 'bytes'"),
            (["3x2@320x240", "--heat", "heat.svg"], 3, "no manifest"),
            (["3x2@320x240", "--heat", "nowhere.json"], 4, "nowhere.json"),
            (["3x2@320x240", "--by", "ms"], 2, "--heat")):
        done = run(folder, "wall", "plan", *arguments, "-o", "no.svg")
        expect(done.returncode == code and words in done.stderr, f"{arguments}: {done.returncode}, {done.stderr}")
    expect(not (folder / "no.svg").exists(), "a plan is written that was refused")


def check_slowest_of_refined_frames(folder):
    """What a picture took in earlier frames is not this frame's doing."""
    ran = run(folder, "wall", "run", "1x1@160x120", "gen:gallery", "--spp", "8", "--target-ms", "1000", "--frames", "4", "-o", "out")
    expect(ran.returncode == 0, ran.stderr)
    for frame in json.loads((folder / "out" / "manifest.json").read_text())["frames"]:
        expect(frame["slowest"]["ms"] <= frame["ms"] + 1.0, f"frame {frame['frame']}: {frame['ms']} ms, {frame['slowest']}")


def turned(pixels, width, height):
    """Turned clockwise and then mirrored left to right, as the panel is sent it."""
    rows = [pixels[4 * width * y:4 * width * (y + 1)] for y in range(height)]
    result = bytearray()
    for x in range(width):
        for y in range(height):  # a clockwise turn has the last row first; the mirror the other way round
            result += rows[y][4 * x:4 * x + 4]
    return bytes(result)


def check_panels(folder):
    (folder / "turned.toml").write_text(TURNED)
    made = run(folder, "wall", "pattern", "turned.toml", "-o", "pattern")
    expect(made.returncode == 0, made.stderr)
    width, height, upright = png.read(folder / "pattern" / "wall-r0c1.png")
    expect((width, height) == (320, 200), f"{width} x {height}")
    expect(png.read(folder / "pattern" / "wall-r0c1.panel.png") == (200, 320, turned(upright, 320, 200)), "the panel's picture")
    hosts = run(folder, "wall", "init", "--cols", "4", "--rows", "1", "--hosts", "a,b", "--tile-pixels", "64x48", "-o", "hosts.toml")
    one = run(folder, "wall", "pattern", "hosts.toml", "--host", "b", "-o", "one")
    expect(hosts.returncode == 0 and one.returncode == 0, one.stderr)
    files = sorted(path.name for path in (folder / "one").iterdir())
    expect(files == ["wall-r0c2.png", "wall-r0c3.png"], f"of host b: {files}")
    for options in (["--host", "c", "-o", "none"], ["--host", "b", "--display", "remote"]):
        expect(run(folder, "wall", "pattern", "hosts.toml", *options).returncode == 2, f"takes {options}")
    flat = run(folder, "wall", "pattern", "2x1@64x48", "-o", "flat")
    files = sorted(path.name for path in (folder / "flat").iterdir())
    expect(flat.returncode == 0 and files == ["wall-r0c0.png", "wall-r0c1.png"], f"{files}")
    expect(run(folder, "wall", "pattern", "2x1@64x48", "-o", "flat").returncode == 4, "overwrites without --force")


def bars(path):
    """The frame's number as the bars have it, the highest bit at the left."""
    width, height, pixels = png.read(path)
    left, wide, y = width // 10, int(0.8 * width) // 16, int(0.65 * height) + int(0.05 * height) // 2
    bits = [pixels[4 * (y * width + left + wide * i + wide // 2 + 1)] for i in range(16)]
    if any(bit not in (0, 255) for bit in bits):
        return f"no bars: {bits}"
    return int("".join("1" if bit else "0" for bit in bits), 2)


def check_counter(folder):
    made = run(folder, "wall", "pattern", "2x1@320x200", "-o", "counted", "--frames", "6", "--fps", "1000", "--keep-frames")
    expect(made.returncode == 0, made.stderr)
    for frame in range(6):
        for screen in ("wall-r0c0", "wall-r0c1"):
            shown = bars(folder / "counted" / f"frame-{frame:06}" / f"{screen}.png")
            expect(shown == frame, f"frame {frame} of {screen} shows {shown}")


def check_counter_on_displays(folder):
    """A display process shows the patterns of a run that goes on until it is stopped."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
    with subprocess.Popen([HPR, "display", "--wall", "2x1@320x200", "-o", "shown"], cwd=folder, env=environment,
                          stderr=subprocess.DEVNULL) as display:
        with subprocess.Popen([HPR, "wall", "pattern", "2x1@320x200", "--display", "remote", "--fps", "20"], cwd=folder,
                              env=environment, stderr=subprocess.PIPE, text=True) as shower:
            until = time.monotonic() + 30
            seen = set()
            while time.monotonic() < until and len(seen) < 3:
                try:
                    seen.add(bars(folder / "shown" / "wall-r0c1.png"))
                except OSError:
                    pass
                time.sleep(0.1)
            shower.send_signal(signal.SIGINT)
            said = shower.communicate(timeout=30)[1]
            expect(shower.returncode == 0, f"the patterns leave with {shower.returncode}: {said}")
            expect(len(seen) >= 3 and all(isinstance(n, int) for n in seen), f"the display counted {seen}")
        display.terminate()


def check_status_line(folder):
    arguments = ["wall", "run", "2x1@64x48", *LIGHT, "--frames", "20", "--display", "none"]
    log = run(folder, *arguments)
    expect(log.returncode == 0 and "\r" not in log.stderr and "[" not in log.stderr, f"a bar in a log: {log.stderr!r}")
    for ranks in ("1", "2"):
        main, terminal = pty.openpty()
        with subprocess.Popen([HPR, *arguments, "--ranks", ranks], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                              stderr=terminal) as job:
            os.close(terminal)
            shown = b""
            while select.select([main], [], [], 60)[0]:
                try:
                    shown += os.read(main, 65536)
                except OSError:  # the other end is closed
                    break
            expect(job.wait(timeout=60) == 0, "the run on a terminal")
        os.close(main)
        lines = [line for line in shown.decode().replace("\n", "\r").split("\r") if "fps" in line]
        wanted = re.compile(r"frame \[#+\] 20/20 [\d.]+ fps( \(min [\d.]+\))?, slowest rank \d on \S+: \S+ [\d.]+ ms *$")
        expect(lines and wanted.match(lines[-1]), f"{ranks} ranks, the last status line: {lines[-1:] or shown!r}")
    piped = run(folder, *arguments, "--ranks", "2", env={**os.environ, "HPR_TERMINAL": "1"})
    expect(piped.returncode == 0 and "\r" not in piped.stderr, f"a bar in the log of two ranks: {piped.stderr!r}")
    quiet = run(folder, "-q", *arguments, "--progress", "line")
    expect(quiet.returncode == 0 and quiet.stderr == "", f"-q says {quiet.stderr}")


def check_status_of_lost_screens(folder):
    """wall status tells of screens whose display is not there."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
    arguments = ["wall", "run", "2x1@64x48", *LIGHT, "--display", "remote", "--until-stopped", "-o", "endless"]
    with subprocess.Popen([HPR, *arguments], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                          text=True) as job:
        until = time.monotonic() + 30
        states = set()
        while time.monotonic() < until and states != {"lost"}:
            told = run(folder, "wall", "status", "--json", env=environment)
            if told.returncode == 0:
                states = {screen["state"] for screen in json.loads(told.stdout)["screens"]}
            time.sleep(0.1)
        expect(states == {"lost"}, f"wall status says {states}")
        stopped = run(folder, "wall", "stop", env=environment)
        said = job.communicate(timeout=30)[1]
        expect(stopped.returncode == 0 and job.returncode == 7 and "no display was there" in said, f"{job.returncode}: {said}")


def main():
    for check in (check_heat, check_slowest_of_refined_frames, check_panels, check_counter, check_counter_on_displays, check_status_line,
                  check_status_of_lost_screens):
        with tempfile.TemporaryDirectory(prefix="hpr-desk-") as scratch:
            check(pathlib.Path(scratch))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
