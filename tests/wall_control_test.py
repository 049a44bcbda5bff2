#!/usr/bin/env python3
"""A wall that runs: it is told what to do, tells how it fares, stops when asked, and survives the loss of a rank.

usage: wall_control_test.py HPR

Prints what differs or is missing and leaves with 1.
"""

import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

from processes import ranks_of
from program import HPR, expect, failures


class Wall:
    """A run in the background, alone in its folder of sockets."""

    def __init__(self, folder, name, ranks, frames, *options):
        self.out = folder / name
        self.runtime = folder / f"{name}-runtime"
        self.runtime.mkdir(mode=0o700, exist_ok=True)
        self.environment = {**os.environ, "XDG_RUNTIME_DIR": str(self.runtime)}
        self.log = open(folder / f"{name}.log", "w+", encoding="utf-8")
        self.job = subprocess.Popen([HPR, "wall", "run", "2x1@64x48", "gen:gallery", "-o", str(self.out), "--ranks",
                                     str(ranks), "--frames", str(frames), "--quality", "draft", *options],
                                    cwd=folder, env=self.environment, stderr=self.log, stdout=self.log)

    def say(self, *words, code=0):
        result = subprocess.run([HPR, "wall", *words], env=self.environment, capture_output=True, text=True, timeout=60,
                                check=False)
        expect(result.returncode == code, f"hpr wall {' '.join(words)} left with {result.returncode}: {result.stderr}")
        return result.stdout

    def wait_for_frame(self, number):
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and self.job.poll() is None:
            result = subprocess.run([HPR, "wall", "status", "--json"], env=self.environment, capture_output=True, text=True,
                                    timeout=60, check=False)
            if result.returncode == 0 and json.loads(result.stdout)["frame"] >= number:
                return json.loads(result.stdout)
            time.sleep(0.05)
        expect(False, f"no frame {number}:\n{self.told()}")
        return {}

    def ranks(self):
        """The processes of the job's ranks: children of mpiexec, which is the run's."""
        return ranks_of(self.job.pid)

    def leave(self, code=0):
        left = self.job.wait(timeout=120)
        expect(left == code, f"the run left with {left}, not {code}:\n{self.told()}")

    def told(self):
        self.log.flush()
        self.log.seek(0)
        return self.log.read()[-3000:]

    def manifest(self):
        return json.loads((self.out / "manifest.json").read_text())


def hashes(frame):
    return {screen["id"]: screen["xxh64"] for screen in frame["screens"]}


def told_and_stopped(folder):
    for ranks in (1, 2):
        wall = Wall(folder, f"told-{ranks}", ranks, 100000)
        status = wall.wait_for_frame(2)
        expect(status.get("schema") == "hpr.wall-status/1" and status.get("ranks") == ranks, f"status: {status}")
        expect([screen["id"] for screen in status.get("screens", [])] == ["wall-r0c0", "wall-r0c1"], f"status has other screens: {status}")
        expect("screen" in wall.say("status"), "status in words names the screens")
        expect("move NODE" in wall.say("ctl", "help"), "ctl help lists the commands")
        wall.say("ctl", "hide", "nothing", code=2)
        wall.say("ctl", "load", "nowhere.glb", code=4)
        if ranks > 1:
            wall.say("ctl", "set", "distribute", "sort-last")
            wall.say("ctl", "strategy", "radix-k:3", code=2)  # cannot be drawn: the run goes on as before
            wall.say("ctl", "set", "distribute", "auto")
        before = wall.wait_for_frame(3)["frame"]
        wall.say("ctl", "camera", "-8,1.7,3", "at", "-10,1.5,-2")
        wall.say("ctl", "passes", "none")
        wall.wait_for_frame(before + 4)
        wall.say("stop")
        wall.leave()
        frames = wall.manifest()["frames"]
        expect(wall.manifest().get("stopped") == {"frames": len(frames), "of": 100000}, "the manifest does not tell of wall stop")
        expect(hashes(frames[0]) != hashes(frames[-1]), "the camera moved, the picture did not")
        out = folder / f"direct-{ranks}"
        direct = subprocess.run([HPR, "wall", "run", "2x1@64x48", "gen:gallery", "-o", str(out), "--quality", "draft", "--passes",
                                 "none", "--frames", str(frames[-1]["frame"] + 1), "--eye=-8,1.7,3", "--at=-10,1.5,-2"], capture_output=True, text=True, timeout=60, check=False)
        expect(direct.returncode == 0, direct.stderr)
        shown = json.loads((out / "manifest.json").read_text())["frames"][-1]  # of one number, and so of one noise
        expect(hashes(frames[-1]) == hashes(shown), "a wall told to look elsewhere shows another picture than one that does")
        expect(not list(wall.runtime.glob("hpr/*.sock")), "a run that ended leaves its socket")
        wall.say("status", code=7)


def stops_and_goes_on(folder):
    """SIGUSR1 ends a run after its frame with 75; --resume goes on, and both are one run: of the same run only."""
    whole = Wall(folder, "uncut", 1, 120)
    whole.leave()
    expected = [hashes(frame) for frame in whole.manifest()["frames"]]
    for ranks in (1, 2):
        name = f"stopped-{ranks}"
        wall = Wall(folder, name, ranks, 120)
        wall.wait_for_frame(2)
        wall.job.send_signal(signal.SIGUSR1)
        wall.leave(75)
        done = len(wall.manifest()["frames"])
        expect(wall.manifest().get("stopped") == {"frames": done, "of": 120}, f"stopped: {wall.manifest().get('stopped')}")
        expect("--resume goes on" in wall.told(), f"the log does not tell how to go on: {wall.told()}")
        command = [HPR, "wall", "run", "2x1@64x48", "gen:gallery", "-o", str(wall.out), "--quality", "draft", "--resume"]
        for options, words in ((["--frames", "121"], "120 frames"), (["--frames", "120", "--seed", "2"], "seed 1"),
                               (["--frames", "120", "--scale", "0.5"], "record 0"),
                               (["--frames", "120", "--set", "test.gap_rgba=[1,2,3,255]"], "another wall")):
            refused = subprocess.run([*command, *options], capture_output=True, text=True, timeout=60, check=False)
            expect(refused.returncode == 3 and words in refused.stderr, f"{options}: {refused.returncode}, {refused.stderr}")
        for options in (["--display", "none", "--frames", "120"], ["--until-stopped"]):
            expect(subprocess.run([*command, *options], capture_output=True, timeout=60, check=False).returncode == 2, f"takes {options}")
        rest = subprocess.run([*command, "--frames", "120", "--ranks", str(3 - ranks)], capture_output=True, text=True, timeout=120,
                              check=False)
        expect(rest.returncode == 0 and f"going on after {done} of 120" in rest.stderr, f"{rest.returncode}, {rest.stderr}")
        expect([hashes(frame) for frame in wall.manifest()["frames"]] == expected, f"{ranks} ranks: two parts differ from the whole")
        expect("stopped" not in wall.manifest(), "it is called stopped still")
        shorter = subprocess.run([*command, "--frames", "100"], capture_output=True, text=True, timeout=60, check=False)
        expect(shorter.returncode == 3 and "120 frames" in shorter.stderr, f"of a whole run: {shorter.returncode}, {shorter.stderr}")
    nothing = Wall(folder, "from-nothing", 1, 3, "--resume")
    nothing.leave()
    expect(len(nothing.manifest()["frames"]) == 3, "--resume without a manifest begins with the first frame")


def survives_a_lost_rank(folder):
    whole = Wall(folder, "whole", 2, 90)
    whole.leave()
    expected = [hashes(frame) for frame in whole.manifest()["frames"]]
    for how in (signal.SIGKILL, signal.SIGSTOP):
        wall = Wall(folder, f"lost-{how.name}", 2, 90, "--hang-timeout", "2")
        wall.wait_for_frame(3)
        ranks = wall.ranks()
        expect(len(ranks) == 2, f"the job has ranks {ranks}")
        if ranks:
            os.kill(ranks[-1], how)
        wall.leave()
        manifest = wall.manifest()
        numbers = [frame["frame"] for frame in manifest["frames"]]
        expect(numbers == list(range(90)), f"{how.name}: frames {numbers[:5]} ... {numbers[-5:]}, {len(numbers)} of 90")
        restarts = manifest.get("restarts", [])
        expect(len(restarts) == 1 and 3 <= restarts[0]["frame"] < 90, f"{how.name}: restarts {restarts}")
        expect([hashes(frame) for frame in manifest["frames"]] == expected, f"{how.name}: other frames than those of a whole run")
        expect("starting it again from frame" in wall.told(), "the log does not tell of the restart")
    first = Wall(folder, "halves", 2, 90)
    first.wait_for_frame(3)
    os.kill(first.ranks()[-1], signal.SIGKILL)
    first.wait_for_frame(6)
    first.job.send_signal(signal.SIGUSR1)
    first.leave(75)
    begun = len(first.manifest()["frames"])
    second = Wall(folder, "halves", 2, 90, "--resume")
    second.wait_for_frame(begun + 1)
    os.kill(second.ranks()[-1], signal.SIGKILL)
    second.leave()
    manifest = second.manifest()
    expect([hashes(frame) for frame in manifest["frames"]] == expected, "lost, stopped, resumed and lost again: other frames")
    restarts = [restart["frame"] for restart in manifest.get("restarts", [])]
    expect(len(restarts) == 2 and restarts[0] < begun < restarts[1], f"restarts before and after frame {begun}: {restarts}")
    wall = Wall(folder, "given-up", 2, 100000, "--restarts", "0")
    wall.wait_for_frame(3)
    os.kill(wall.ranks()[0], signal.SIGKILL)
    wall.leave(7)


def takes_its_socket_along(folder):
    """A run that a signal ends leaves no socket, of one rank or of several."""
    for ranks, number in ((1, signal.SIGTERM), (1, signal.SIGINT), (2, signal.SIGTERM), (2, signal.SIGINT)):
        wall = Wall(folder, f"ended-{ranks}-{int(number)}", ranks, 100000)
        wall.wait_for_frame(1)
        expect(list(wall.runtime.glob("hpr/*.sock")), "a run has no socket")
        wall.job.send_signal(number)
        wall.leave(-number)
        left = list(wall.runtime.glob("hpr/*.sock"))
        expect(not left, f"signal {number} leaves {left} of {ranks} ranks")


def keeps_the_socket_of_a_run_that_begins(folder):
    (folder / "hpr").mkdir(mode=0o700)
    path = folder / "hpr" / "wall-1.sock"
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(path))  # and does not listen: not yet, or never again
        for seconds_old, there in ((0, True), (3600, False)):
            os.utime(path, (time.time() - seconds_old,) * 2)
            status = subprocess.run([HPR, "wall", "status"], env={**os.environ, "XDG_RUNTIME_DIR": str(folder)},
                                    capture_output=True, text=True, timeout=60, check=False)
            expect(status.returncode == 7, f"nobody listens, and status leaves with {status.returncode}")
            expect(path.exists() == there, f"a socket of {seconds_old} s that refuses is {'there' if path.exists() else 'gone'}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-ctl-") as scratch:
        keeps_the_socket_of_a_run_that_begins(pathlib.Path(scratch))
        told_and_stopped(pathlib.Path(scratch))
        takes_its_socket_along(pathlib.Path(scratch))
        stops_and_goes_on(pathlib.Path(scratch))
        survives_a_lost_rank(pathlib.Path(scratch))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
