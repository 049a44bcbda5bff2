#!/usr/bin/env python3
"""A frame of a wall that cannot be drawn: the screen keeps the one before, the run goes on and ends with 1.

usage: frame_failure_test.py HPR

A frame of more pixels needs more shared memory than there is: /dev/shm of a mount namespace of its own, for which the
test is skipped (77) where it may not make one. Prints what was wrong and leaves with 1.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

from program import HPR, expect, failures

INSIDE = "HPR_TEST_INSIDE"
# 77 MB of keys on two ranks, 3 MB at a fifth of the resolution.
COMMAND = ["wall", "run", "1x1@2400x2000", "gen:gallery", "--passes", "none", "--ranks", "2", "--distribute", "sort-last",
           "--strategy", "shared-memory", "--resolution-scale", "0.2", "--frames", "1000", "--display", "file", "-o", "out"]
ENTER = 'mount -t tmpfs -o size=64M tmpfs /dev/shm && exec "$@"'


def hpr(*words):
    return subprocess.run([HPR, *words], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False)


def wait_for_frame(wall, number):
    """Frames are counted whether they could be drawn or not."""
    until = time.monotonic() + 60
    while time.monotonic() < until and wall.poll() is None:
        result = hpr("wall", "status", "--json")
        if result.returncode == 0 and json.loads(result.stdout)["frame"] >= number:
            return json.loads(result.stdout)["frame"]
        time.sleep(0.05)
    expect(False, f"no frame {number}")
    return number


def ended_run(arguments, meanwhile):
    """What a run says that is stopped once `meanwhile` is done; with its exit code."""
    with open("log", "w+", encoding="utf-8") as log:
        wall = subprocess.Popen([HPR, *COMMAND, *arguments], stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            meanwhile(wall)
            hpr("wall", "stop")
            code = wall.wait(timeout=60)
        finally:
            wall.kill()
        log.seek(0)
        return code, log.read()


def change_resolution(wall):
    wait_for_frame(wall, 1)
    for scale in ("1", "0.3"):
        result = hpr("wall", "ctl", "set", "resolution-scale", scale)
        expect(result.returncode == 0, f"wall ctl: {result.stderr}")
    wait_for_frame(wall, wait_for_frame(wall, 0) + 2)


def bad_frames():
    code, said = ended_run([], change_resolution)
    expect(code == 1, f"the run left with {code}:\n{said[-2000:]}")
    frames = json.loads(pathlib.Path("out/manifest.json").read_text())["frames"]
    failed = [frame["frame"] for frame in frames if "failed" in frame]
    if not expect(failed and max(failed) + 1 < len(frames), f"failed of {len(frames)}: {failed}\n{said[-2000:]}"):
        return
    kept = frames[failed[0] - 1]["screens"][0]
    for number in failed:
        screen = frames[number]["screens"][0]
        expect("shared memory" in frames[number]["failed"], frames[number]["failed"])
        expect(screen["state"] == "stale" and screen["xxh64"] == kept["xxh64"], f"frame {number} shows {screen}")
    after = frames[failed[-1] + 1]["screens"][0]
    expect(after["state"] == "fresh" and after["xxh64"] != kept["xxh64"], f"the frame after: {after}")
    names = ", ".join(str(number) for number in failed[:10])
    listed = f"{len(failed)} frame{'s' if len(failed) > 1 else ''} failed: {names}"
    expect("shared memory" in said and "drawing it once more" in said and listed in said, said[-2000:])

    code, said = ended_run(["--resume"], lambda wall: wait_for_frame(wall, len(frames)))
    expect(code == 1 and listed in said, f"the run that goes on left with {code}:\n{said[-2000:]}")
    again = json.loads(pathlib.Path("out/manifest.json").read_text())["frames"]
    expect([frame["frame"] for frame in again if "failed" in frame] == failed, "the manifest forgets what failed")


def main():
    if os.environ.get(INSIDE):
        bad_frames()
        return 1 if failures else 0
    if subprocess.run(["unshare", "-m", "sh", "-c", ENTER, "sh", "true"], capture_output=True, check=False).returncode != 0:
        print("skipped: no mount namespace can be made here")
        return 77
    with tempfile.TemporaryDirectory(prefix="hpr-frame-failure-") as scratch:
        environment = {**os.environ, INSIDE: "1", "XDG_RUNTIME_DIR": scratch}
        inside = ["unshare", "-m", "sh", "-c", ENTER, "sh", sys.executable, os.path.abspath(__file__), HPR]
        return subprocess.run(inside, cwd=scratch, env=environment, timeout=240, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
