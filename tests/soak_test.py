#!/usr/bin/env python3
"""Walls that run for long while their displays and ranks are killed and commands come in: label soak, by hand.

usage: soak_test.py HPR [--minutes M] [--runs R] [--every S] [--seed N]

R walls of three screens at once, two ranks each, pictures sent to display processes. Every S seconds of each run, at
random, a display or a rank is killed; the display is started again, the job starts itself again. Every few seconds a
command changes what is seen. The first run's ranks are spared, so that their memory and descriptors tell of leaks.
Prints what happened as JSON; leaves with 1 after a crash, a refused restart, a run that did not end by itself, memory
of the spared ranks that grew by more than a tenth in the second half, or descriptors that became more.
"""

import argparse
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import tempfile
import time

from display_harness import HPR, SCENE, Display, environment
from processes import ranks_of, send

COMMANDS = ["camera 0,1.7,4 at 0,1.6,-2", "camera -3,1.7,3 at 0,1.5,-2", "camera 3,1.2,2 at 1,1.5,-2"]


def resident_kib(pid):
    found = re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{pid}/status").read_text(encoding="utf-8"))
    return int(found.group(1)) if found else 0


class Run:
    """One wall, its display process, and what is done to them."""

    def __init__(self, root, index, arguments, dice):
        self.folder = root / f"run{index}"
        self.folder.mkdir()
        self.index, self.dice, self.every = index, dice, arguments.every
        self.wall = f"3x1@{160 + 16 * index}x120"
        self.log = open(self.folder / "run.log", "w+", encoding="utf-8")
        self.display = Display(self.folder, self.wall, "localhost")
        self.process = subprocess.Popen(
            [HPR, "wall", "run", self.wall, SCENE, "--passes", "none", "--display", "remote", "--until-stopped",
             "--ranks", "2", "--threads", "1", "--restarts", "1000"], cwd=self.folder, env=environment(self.folder),
            stdout=subprocess.DEVNULL, stderr=self.log)
        self.killed = {"display": 0, "rank": 0}
        self.commands = self.commands_taken = 0
        self.samples = []
        now = time.monotonic()
        self.next_kill = now + dice.uniform(5, 5 + arguments.every)
        self.next_command = now + 5
        self.next_sample = now + 20

    def ranks(self):
        return ranks_of(self.process.pid)

    def step(self, now):
        if now >= self.next_kill:
            self.next_kill = now + self.dice.uniform(0.35, 1.0) * self.every
            self.kill()
        if now >= self.next_command:
            self.next_command = now + self.dice.uniform(1, 4)
            self.commands += 1
            taken = subprocess.run([HPR, "wall", "ctl", *self.dice.choice(COMMANDS).split()], cwd=self.folder,
                                   env=environment(self.folder), capture_output=True, timeout=60, check=False)
            self.commands_taken += taken.returncode == 0
        if now >= self.next_sample and self.index == 0:
            self.next_sample = now + 5
            try:
                self.samples.append([sum(map(resident_kib, self.ranks())),
                                     sum(len(os.listdir(f"/proc/{pid}/fd")) for pid in self.ranks())])
            except OSError:
                pass

    def kill(self):
        ranks = self.ranks()
        if self.index > 0 and ranks and self.dice.random() < 0.5:
            self.killed["rank"] += send(self.dice.choice(ranks), signal.SIGKILL)  # it may be a job that is starting again
            return
        self.display.kill()
        self.display.log.close()
        time.sleep(self.dice.uniform(0, 1.5))
        self.display = Display(self.folder, self.wall, "localhost")
        self.killed["display"] += 1

    def end(self):
        """What became of it."""
        until, answers = time.monotonic() + 60, []
        while time.monotonic() < until and self.process.poll() is None:  # a job that is starting cannot be told yet
            stop = subprocess.run([HPR, "wall", "stop"], cwd=self.folder, env=environment(self.folder), capture_output=True,
                                  text=True, timeout=60, check=False)
            answers.append(stop.stderr.strip())
            if stop.returncode == 0:
                break
            time.sleep(2)
        try:
            code = self.process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = "did not end"
        with self.display:
            pass
        self.log.seek(0)
        said = self.log.read()
        both = said + self.display.said()
        return {"exit": code, "killed": self.killed, "restarts": len(re.findall(r"starting it again", said)),
                "crashes": len(re.findall(r"signal (?:4|6|7|8|11)\b|corrupted|double free|Sanitizer", both)),
                "refused": len(re.findall(r"refuses:", said)), "commands": [self.commands_taken, self.commands],
                "samples": self.samples, "stop": answers, "said": said[-2000:] if code != 0 else ""}


def leaks(samples):
    """What grew in the second half of the samples, [KiB, descriptors] each."""
    half = samples[len(samples) // 2:]
    if len(half) < 4:
        return []
    quarter = len(half) // 4
    mean = lambda part, which: sum(sample[which] for sample in part) / len(part)
    found = []
    if mean(half[-quarter:], 0) > 1.1 * mean(half[:quarter], 0):
        found.append("memory")
    if max(sample[1] for sample in half[-quarter:]) > max(sample[1] for sample in half[:quarter]) + 2:
        found.append("descriptors")
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--every", type=float, default=20)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    dice = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory(prefix="hpr-soak-") as scratch:
        runs = [Run(pathlib.Path(scratch), index, arguments, dice) for index in range(arguments.runs)]
        end = time.monotonic() + 60 * arguments.minutes
        while time.monotonic() < end:
            for run in runs:
                if run.process.poll() is None:
                    run.step(time.monotonic())
            time.sleep(0.05)
        results = [run.end() for run in runs]
    grown = leaks(results[0]["samples"])
    print(json.dumps({"minutes": arguments.minutes, "runs": results, "grown": grown}, indent=1))
    bad = [index for index, result in enumerate(results)
           if result["exit"] != 0 or result["crashes"] or result["refused"] or not result["commands"][0]]
    return 1 if bad or grown else 0


if __name__ == "__main__":
    sys.exit(main())
