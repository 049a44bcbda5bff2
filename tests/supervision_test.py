#!/usr/bin/env python3
"""Ranks that are lost, stand still or are stopped: who is named, and that the run starts them again.

usage: supervision_test.py HPR

Prints what differs and leaves with 1.
"""

import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

from processes import children_of, ranks_of, send, words_of
from program import HPR, expect, failures

HOST = os.uname().nodename
# What launchers that --launcher names need here.
OF_LAUNCHERS = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}


class Run:
    """A wall that goes on until it is stopped, alone in its folder of sockets."""

    def __init__(self, folder, name, *options, display="none", environment=None):
        self.name, self.folder = name, folder / name
        self.folder.mkdir()
        self.environment = {**os.environ, "XDG_RUNTIME_DIR": str(self.folder), **(environment or {})}
        self.log = self.folder / "log"
        with open(self.log, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(
                [HPR, "wall", "run", "2x1@64x48", "gen:gallery", "--display", display, "--until-stopped", "--passes", "none",
                 "-o", "out", *options], cwd=self.folder, env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def told(self):
        return self.log.read_text(encoding="utf-8")

    def status(self):
        found = subprocess.run([HPR, "wall", "status", "--json"], env=self.environment, capture_output=True, text=True,
                               timeout=60, check=False)
        return json.loads(found.stdout) if found.returncode == 0 and found.stdout else {}

    def wait_for_frame(self):
        self.wait(lambda: self.status().get("frame") is not None, "draws no frame")

    def wait(self, happens, otherwise, seconds=60):
        until = time.monotonic() + seconds
        while time.monotonic() < until and self.process.poll() is None:
            if happens():
                return True
            time.sleep(0.05)
        return expect(False, f"{self.name}: {otherwise}:\n{self.told()}")

    def restarts(self):
        return len(re.findall("starting it again", self.told()))

    def rank(self, number):
        """The process of a rank: one alone is the run's own child."""
        children = children_of(self.process.pid)
        ranks = ranks_of(self.process.pid)
        return ranks[number] if ranks else children[0]

    def end(self):
        """Once it draws again: it stops when it is told to."""
        self.wait_for_frame()
        stopped = subprocess.run([HPR, "wall", "stop"], env=self.environment, capture_output=True, text=True, timeout=60, check=False)
        expect(stopped.returncode == 0, f"{self.name}: wall stop: {stopped.stderr}")
        self.leave(0)

    def leave(self, code):
        try:
            left = self.process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            left = "nothing: it goes on"
            self.process.kill()
        expect(left == code, f"{self.name}: left with {left}, not {code}:\n{self.told()}")


def is_started_again(run, words):
    """And the log says why, in these words."""
    run.wait(lambda: run.restarts() == 1, "is not started again")
    expect(re.search(words, run.told()), f"{run.name}: no '{words}' in:\n{run.told()}")
    run.end()


def a_killed_rank(folder):
    for ranks in (1, 2):
        run = Run(folder, f"killed-{ranks}", "--ranks", str(ranks))
        run.wait_for_frame()
        os.kill(run.rank(ranks - 1), signal.SIGKILL)
        is_started_again(run, rf"a rank was ended by signal 9 \(Killed\): rank {ranks - 1} on {HOST}: .+ of frame \d+")


def lost_before_it_draws(folder):
    """As often as --restarts allows: nothing says that a frame ended it."""
    run = Run(folder, "early", "--ranks", "2", "--hang-timeout", "5s")
    for number in (1, 2):
        if run.wait(lambda: len(ranks_of(run.process.pid)) == 2, "starts no ranks"):
            send(run.rank(0), signal.SIGKILL)
        # Open MPI may wait for a rank that is lost while it starts: up to the launcher's limit.
        run.wait(lambda: run.restarts() == number, f"is not started again, time {number}", seconds=120)
    run.end()


def lost_while_they_start(folder):
    """Of a launcher that does not notice, and ignores SIGTERM: so is Open MPI's, where a rank ends while it connects to it."""
    again = folder / "again"  # from the second job on all is as it should be
    rank = folder / "waits-as-rank-1"
    rank.write_text(f'#!/bin/sh\n[ "$OMPI_COMM_WORLD_RANK" = 1 ] && [ ! -e {again} ] && exec sleep 1000\nexec "$@"\n')
    launcher = folder / "goes-on-at-first"
    launcher.write_text(f'#!/bin/sh\n[ -e {again} ] && exec mpiexec -n 2 {rank} "$@"\ntrap "" TERM\nmpiexec -n 2 {rank} "$@"\nexec sleep 1000\n')
    for script in (rank, launcher):
        script.chmod(0o755)
    run = Run(folder, "unnoticed", "--ranks", "2", "--launcher", str(launcher), "--hang-timeout", "10", environment=OF_LAUNCHERS)
    has_joined = lambda pid: b"OMPI_COMM_WORLD_RANK=0\0" in words_of(pid, "environ") and b"hpr-job-board" in words_of(pid, "maps")
    joined = lambda: [pid for mpiexec in ranks_of(run.process.pid) for pid in children_of(mpiexec) if has_joined(pid)]
    if run.wait(joined, "starts no rank 0"):
        time.sleep(0.2)  # the board is written to soon after it is mapped
        send(joined()[0], signal.SIGKILL)
    again.touch()
    is_started_again(run, rf"a rank ended while 2 ranks started: rank 0 on {HOST}: start of MPI; starting it again")


def a_frame_that_ends_two_jobs(folder):
    """Ends the run too, where it knows its last frame."""
    with open(folder / "twice.log", "w", encoding="utf-8") as log:
        process = subprocess.Popen([HPR, "wall", "run", "2x1@64x48", "gen:gallery", "--display", "none", "--frames", "2", "--passes", "none",
                                    "--spp", "1000000"], cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
    told = lambda: (folder / "twice.log").read_text(encoding="utf-8")
    for number in (0, 1):
        until = time.monotonic() + 60
        while time.monotonic() < until and (told().count("starting it again") < number or not children_of(process.pid)):
            time.sleep(0.05)
        time.sleep(3)
        os.kill(children_of(process.pid)[0], signal.SIGKILL)
    code = process.wait(timeout=60)
    expect(code == 7 and "frame 0 ended two jobs" in told(), f"twice: {code}, {told()}")


def a_rank_that_stands_still(folder):
    for ranks in (1, 2):
        run = Run(folder, f"still-{ranks}", "--ranks", str(ranks), "--hang-timeout", "1", "--trace", "trace.json")
        run.wait_for_frame()
        os.kill(run.rank(ranks - 1), signal.SIGSTOP)
        waits = rf"(?=.*rank 1 on {HOST}: )(?=.*rank 0 on {HOST}: [^;]*waiting for rank 1)" if ranks == 2 else f"rank 0 on {HOST}: "
        is_started_again(run, rf"(no rank has got on for 1 s|where the ranks were): {waits}")


def a_hung_run_that_is_told_to_end(folder):
    run = Run(folder, "ended", "--hang-timeout", "2")
    run.wait_for_frame()
    os.kill(run.rank(0), signal.SIGSTOP)
    run.process.send_signal(signal.SIGTERM)
    run.leave(8)
    expect(run.restarts() == 0, f"ended: started again:\n{run.told()}")


def state_of(pid):
    return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]


def a_suspended_run(folder):
    """Ctrl-Z stops a lone rank too, and both go on."""
    run = Run(folder, "suspended")
    run.wait_for_frame()
    rank = run.rank(0)
    run.process.send_signal(signal.SIGTSTP)
    run.wait(lambda: (state_of(run.process.pid), state_of(rank)) == ("T", "T"), "does not stop with its rank")
    run.process.send_signal(signal.SIGCONT)
    run.wait(lambda: "T" not in (state_of(run.process.pid), state_of(rank)), "does not go on")
    run.end()
    expect(run.restarts() == 0, f"suspended: started again:\n{run.told()}")


def a_stopped_mpiexec(folder):
    run = Run(folder, "stopped", "--ranks", "2", "--hang-timeout", "1")
    run.wait_for_frame()
    os.kill(children_of(run.process.pid)[0], signal.SIGSTOP)
    is_started_again(run, r"mpiexec was stopped[\s\S]*mpiexec has been stopped for 1 s")


def a_stop_that_ends(folder):
    """Nothing is done where a stopped mpiexec goes on soon."""
    run = Run(folder, "continued", "--ranks", "2", "--hang-timeout", "30")
    run.wait_for_frame()
    mpiexec = children_of(run.process.pid)[0]
    os.kill(mpiexec, signal.SIGSTOP)
    run.wait(lambda: "was stopped" in run.told(), "a stopped mpiexec is not told of")
    os.kill(mpiexec, signal.SIGCONT)
    run.end()
    expect(run.restarts() == 0, f"continued: started again:\n{run.told()}")


def a_rank_of_a_picture(folder):
    """Of commands that nothing starts again the error names it too."""
    for command in (["render", "gen:gallery", "-o", "x.png", "--spp", "100000"],
                    ["compare", "gen:gallery", "--frames", "100000", "--size", "64x48"]):
        name = command[0]
        with open(folder / f"{name}.log", "w", encoding="utf-8") as log:
            process = subprocess.Popen([HPR, *command, "--ranks", "2"], cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        until = time.monotonic() + 30
        while len(ranks_of(process.pid)) < 2 and time.monotonic() < until:
            time.sleep(0.05)
        time.sleep(2)
        os.kill(ranks_of(process.pid)[1], signal.SIGKILL)
        code = process.wait(timeout=60)
        told = (folder / f"{name}.log").read_text(encoding="utf-8")
        expect(code == 7 and re.search(rf"a rank was ended by signal 9 \(Killed\): rank 1 on {HOST}: \w+", told), f"{name}: {code}, {told}")


def lives(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    except OSError:
        return False


def nobody_is_left(folder):
    """After kill -9 of who started the ranks."""
    for name, ranks, who in (("mpiexec", 2, lambda run: children_of(run.process.pid)[0]), ("hpr", 2, lambda run: run.process.pid),
                             ("hpr-of-one", 1, lambda run: run.process.pid)):
        run = Run(folder, f"left-by-{name}", "--ranks", str(ranks))
        run.wait_for_frame()
        before = [*children_of(run.process.pid), *ranks_of(run.process.pid)]
        expect(len(before) == (3 if ranks == 2 else 1), f"{name}: {before}")
        os.kill(who(run), signal.SIGKILL)
        until = time.monotonic() + 15
        while any(map(lives, before)) and time.monotonic() < until:
            time.sleep(0.05)
        expect(not any(map(lives, before)), f"{name}: of {before} are left {[pid for pid in before if lives(pid)]}")
        if name == "mpiexec":
            is_started_again(run, r"mpiexec was ended by signal 9|a rank was ended by signal 9")
        else:
            run.leave(-signal.SIGKILL)


def nobody_hears_it(folder):
    """What is said on stderr gets lost, and nothing else does."""
    for name, options in (("full", {"stderr": open("/dev/full", "w", encoding="utf-8")}), ("closed", {"preexec_fn": lambda: os.close(2)})):
        for ranks in ("1", "2"):
            picture = folder / f"{name}-{ranks}.png"
            code = subprocess.run([HPR, "render", "gen:gallery", "-o", str(picture), "--size", "64x48", "--passes", "none", "-v", "--ranks", ranks],
                                  stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, timeout=60, check=False, **options).returncode
            expect(code == 0 and picture.exists(), f"stderr {name}, {ranks} ranks: {code}")


def a_lone_rank_unsupervised(folder):
    run = Run(folder, "plain", "--restarts", "0")
    run.wait_for_frame()
    expect(not children_of(run.process.pid), "with --restarts 0 a lone rank has a process of its own")
    run.end()


def another_launcher(folder):
    """The journal is where all hosts find it, and goes; that of a killed run goes with the next one."""
    temporary = lambda run: sorted(path.name for path in (run.folder / "out").glob(".hpr-*.part"))
    os.environ.update(OF_LAUNCHERS)
    (folder / "mpiexec with blanks").symlink_to(subprocess.run(["which", "mpiexec"], capture_output=True, text=True, check=True).stdout.strip())
    run = Run(folder, "launcher", "--ranks", "2", "--launcher", f'"{folder}/mpiexec with blanks" -n {{ranks}}', display="remote")
    run.wait_for_frame()
    left = temporary(run)
    expect(len(left) == 1, f"the journal is not in the folder: {left}")
    os.kill(run.rank(0), signal.SIGKILL)
    run.wait(lambda: run.restarts() == 1, "is not started again")
    run.wait_for_frame()
    run.process.kill()
    run.process.wait()
    expect(temporary(run) == left, "a killed run took its journal along")
    for name in left:
        os.utime(run.folder / "out" / name, (0, 0))  # young ones may be another run's
    again = subprocess.run([HPR, "wall", "run", "2x1@64x48", "gen:gallery", "--display", "remote", "-o", "out", "--force", "--frames", "2",
                            "--passes", "none", "--ranks", "2", "--launcher", "mpiexec -n {ranks}"], cwd=run.folder, env=run.environment,
                           capture_output=True, text=True, timeout=120, check=False)
    expect(again.returncode == 7, f"nobody showed its frames, yet: {again.returncode}, {again.stderr}")
    expect(not temporary(run), f"journals stay: {temporary(run)}")
    ended = Run(folder, "launcher-ended", "--launcher", "mpiexec -n {ranks}", display="remote")
    ended.wait_for_frame()
    expect(len(ranks_of(ended.process.pid)) == 1, "a lone rank has no launcher")
    ended.process.send_signal(signal.SIGTERM)
    ended.leave(7)  # nobody showed its frames
    interrupted = subprocess.Popen([HPR, "wall", "run", "2x1@64x48", "gen:gallery", "--display", "remote", "-o", "interrupted", "--frames", "100000",
                                    "--passes", "none", "--ranks", "2", "--launcher", "mpiexec -n {ranks}"], cwd=run.folder, env=run.environment,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 30
    while len(ranks_of(interrupted.pid)) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    interrupted.send_signal(signal.SIGTERM)
    code = interrupted.wait(timeout=60)
    expect(code == -signal.SIGTERM and not list((run.folder / "interrupted").glob(".hpr-*")), f"interrupted: {code}, its journal stays")
    hidden = folder / "hidden"
    hidden.write_text('#!/bin/sh\n[ "$OMPI_COMM_WORLD_RANK" = 1 ] && unset HPR_JOB_BOARD\nexec "$@"\n')
    hidden.chmod(0o755)
    elsewhere = Run(folder, "elsewhere", "--ranks", "3", "--launcher", f"mpiexec -n {{ranks}} {hidden}")
    elsewhere.wait_for_frame()
    os.kill(next(pid for pid in ranks_of(elsewhere.process.pid)
                 if b"OMPI_COMM_WORLD_RANK=1\0" in words_of(pid, "environ")), signal.SIGKILL)
    is_started_again(elsewhere, r"process rank 1 .*[\s\S]*a rank or mpiexec was ended by signal 9")
    for words, mention in (("env", "not as a rank of an MPI job"), ("no-such-launcher -n 2", "no no-such-launcher on the PATH"), ('"', "is no command")):
        wrong = subprocess.run([HPR, "wall", "run", "2x1@64x48", "gen:gallery", "--display", "none", "--ranks", "2", "--launcher", words], cwd=run.folder,
                               capture_output=True, text=True, timeout=60, check=False)
        expect(mention in wrong.stderr, f"--launcher {words}: {wrong.stderr}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-supervision-") as scratch:
        for case in (a_killed_rank, lost_before_it_draws, lost_while_they_start, a_frame_that_ends_two_jobs, a_rank_that_stands_still,
                     a_hung_run_that_is_told_to_end, a_suspended_run, a_stopped_mpiexec,
                     a_stop_that_ends, a_rank_of_a_picture, nobody_is_left, nobody_hears_it, a_lone_rank_unsupervised, another_launcher):
            case(pathlib.Path(scratch))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
