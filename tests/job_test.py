#!/usr/bin/env python3
"""What becomes of a job that hpr starts when its output is not taken, or a signal comes.

usage: job_test.py HPR

Prints what was wrong and leaves with 1.
"""

import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from program import HPR, expect, failures

WALL = ["wall", "run", "2x1@64x48", "gen:cornell", "--quality", "draft", "--passes", "none", "--frames", "100000"]
def output_nobody_takes(folder, ranks):
    """A full disk, and a reader that goes away."""
    explain = [HPR, "render", "gen:cornell", "-o", f"a{ranks}.png", "--size", "32x24", "--quality", "draft", "--explain",
               "--ranks", str(ranks)]
    with open("/dev/full", "wb") as full:
        code = subprocess.run(explain, cwd=folder, stdout=full, stderr=subprocess.PIPE, timeout=60, check=False).returncode
    expect(code == 4, f"{ranks} ranks: output to a full disk left with {code}")
    pipe = subprocess.Popen([HPR, *WALL, "--display", "pipe", "-o", "-", "--ranks", str(ranks)], cwd=folder,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    pipe.stdout.read(10)
    pipe.stdout.close()
    said = pipe.communicate(timeout=60)[1].decode()
    expect(pipe.returncode == 4, f"{ranks} ranks: frames to a reader that went left with {pipe.returncode}:\n{said[-1500:]}")
    closed = subprocess.run([HPR, "wall", "check", "2x2", "--json"], preexec_fn=lambda: os.close(1), stderr=subprocess.PIPE,
                            timeout=60, check=False).returncode
    expect(closed == 4, f"a closed output left with {closed}")


def started(folder, name, ranks):
    run = subprocess.Popen([HPR, *WALL, "-o", name, "--keep-frames", "--ranks", str(ranks)], cwd=folder,
                           stderr=subprocess.PIPE, start_new_session=True)
    until = time.monotonic() + 60
    while not (folder / name / "frame-000002").exists() and run.poll() is None and time.monotonic() < until:
        time.sleep(0.02)
    return run


def interrupted(folder, ranks, number, whole_session):
    """When hpr has gone, nobody writes on."""
    name = f"out-{ranks}-{number}-{whole_session}"
    run = started(folder, name, ranks)
    os.killpg(run.pid, number) if whole_session else run.send_signal(number)
    run.communicate(timeout=30)
    frames = len(list((folder / name).iterdir()))
    time.sleep(0.5)
    later = len(list((folder / name).iterdir()))
    expect(run.returncode == -number, f"{name}: left with {run.returncode}")
    expect(frames == later, f"{name}: {later - frames} files were written after hpr had left")


def stopped(folder, ranks):
    """SIGUSR1 is an orderly end before all frames are done: what was drawn is written down."""
    name = f"stopped-{ranks}"
    run = started(folder, name, ranks)
    run.send_signal(signal.SIGUSR1)
    said = run.communicate(timeout=60)[1].decode()
    expect(run.returncode == 75, f"{name}: left with {run.returncode}:\n{said[-1500:]}")
    frames = json.loads((folder / name / "manifest.json").read_text())["frames"]
    expect(len(frames) >= 2, f"{name}: {len(frames)} frames are written down")


def ignored(folder):
    """What nohup has a program ignore, it ignores; and a reader that stands still keeps nobody."""
    run = subprocess.Popen([HPR, *WALL, "-o", "nohup", "--keep-frames", "--ranks", "2"], cwd=folder, stderr=subprocess.DEVNULL,
                           preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    until = time.monotonic() + 60
    while not (folder / "nohup" / "frame-000001").exists() and time.monotonic() < until:
        time.sleep(0.02)
    run.send_signal(signal.SIGHUP)
    time.sleep(0.5)
    expect(run.poll() is None, f"a hang-up ended a run that was to ignore it: {run.returncode}")
    run.terminate()
    run.wait(timeout=30)
    stuck = subprocess.Popen([HPR, *WALL, "--display", "pipe", "-o", "-", "--ranks", "2"], cwd=folder, stdout=subprocess.PIPE,
                             stderr=subprocess.DEVNULL)
    time.sleep(3)
    stuck.terminate()
    try:
        stuck.wait(timeout=10)
    except subprocess.TimeoutExpired:
        stuck.kill()
        stuck.wait()
    expect(stuck.returncode == -signal.SIGTERM, f"a run whose reader stands still left with {stuck.returncode} when told to end")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-job-") as scratch:
        folder = pathlib.Path(scratch)
        for ranks in (1, 2):
            output_nobody_takes(folder, ranks)
            stopped(folder, ranks)
            interrupted(folder, ranks, signal.SIGTERM, False)
        ignored(folder)
        interrupted(folder, 2, signal.SIGINT, False)
        interrupted(folder, 2, signal.SIGINT, True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
