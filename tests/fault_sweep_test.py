#!/usr/bin/env python3
"""Lets every n-th call fail once: memory, writes, syncs, renames, files that are made, sockets, messages.

usage: fault_sweep_test.py HPR FAULTS [--full] [--most N] [--seed N] [CASE...]

FAULTS is the library of tests/faults. Of calls for files every one fails, of those for memory, sockets and messages
the first from each place in the program that no case before had, or a sample of these. Each run must leave with a code
that fits the fault and an error that names it, leave no file that is not complete, no temporary file and no process,
and end in time. Prints what is wrong and leaves with 1.
"""

import concurrent.futures
import contextlib
import itertools
import json
import os
import pathlib
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time

import png

HPR = os.path.abspath(sys.argv[1])
FAULTS = os.path.abspath(sys.argv[2])
FULL = "--full" in sys.argv


def option(name, otherwise):
    return int(sys.argv[sys.argv.index(name) + 1]) if name in sys.argv else otherwise


SEED = option("--seed", 1)
MOST = option("--most", 400 if FULL else 6)  # calls of a kind that fail, where there are many
TIMEOUT = 90  # seconds of a run that takes one
GONE = 10  # seconds until its last process must have left
failures = []

# By kind: the codes a run may leave with, and the words of which its error has one.
OUTCOMES = {
    "alloc": ({0, 6}, ["out of memory", "Cannot allocate memory"]),
    "write": ({0, 4}, ["No space left on device"]),
    "fsync": ({0, 4}, ["Input/output error"]),
    "rename": ({0, 4}, ["Input/output error"]),
    "open": ({0, 4}, ["No space left on device"]),
    "unnamed": ({0}, []),
    "socket": ({0, 4, 7}, ["Too many open files", "Connection refused", "Connection reset", "display"]),
    "mpi": ({0, 7}, ["MPI_"]),
}
FILES = ["write", "fsync", "rename", "open", "unnamed"]
SCENE = "gen:gallery"
WALL = "2x1@32x24"
NO_RANK = ""  # the process that is no rank of a job


class Case:
    """A command in a folder of its own. `swept`: by rank, the kinds of which calls fail in it."""

    def __init__(self, name, arguments, results, swept, code=0, other_ends=(), other_results=(), signal_after=None, display=None, quick=True):
        self.name = name
        self.arguments = arguments
        self.results = results
        self.swept = swept
        self.code = code  # that it leaves with when nothing fails
        self.other_ends = set(other_ends)  # codes it may leave with as well, because it goes on without what failed
        self.other_results = set(other_results)  # and what it leaves then
        self.quick = quick  # whether it is part of the short sweep
        self.signal_after = signal_after  # words of its stderr at which it is sent SIGUSR1
        self.display = display  # where the fault is: "run" or "display"; None: there is no display


def light(*arguments):
    return [*arguments, "--threads", "1"]


SMALL = light("render", SCENE, "--size", "32x24", "--passes", "shadow")
CASES = [
    Case("validate", ["scene", "validate", SCENE, "--json"], [], {NO_RANK: ["alloc"]}),
    Case("picture", [*SMALL, "-o", "x.png"], ["x.png"], {NO_RANK: ["alloc", *FILES]}),
    Case("exr", [*SMALL, "-o", "x.exr", "--raw", "x.keys", "--aov", "depth,id", "--stats", "x.json"], ["x.exr", "x.keys", "x.json"],
         {NO_RANK: ["alloc", *FILES]}, quick=False),
    Case("ranks", [*SMALL, "-o", "x.png", "--ranks", "2", "--hang-timeout", "20s"], ["x.png"],
         {NO_RANK: ["alloc"], "0": ["alloc", "mpi", *FILES], "1": ["alloc", "mpi"]}),
    Case("checkpoint", light("render", SCENE, "--size", "8x8", "--passes", "shadow", "-o", "x.png", "--spp", "1000", "--progress", "line", "--photons", "10"),
         ["x.png.checkpoint"], {NO_RANK: ["alloc", *FILES]}, code=75, other_ends=[0], other_results=["x.png"], signal_after="hpr: sample "),
    Case("compare", light("compare", "--synthetic", "half", "--size", "70x66", "--ranks", "2", "--frames", "1", "--warmup", "0", "--csv", "x.csv",
                          "-o", "x.png", "--hang-timeout", "20s"),
         ["x.csv", "x.png"], {NO_RANK: ["alloc", *FILES], "0": ["alloc", "mpi"], "1": ["alloc", "mpi"]}, quick=False),
    Case("wall", light("wall", "run", WALL, SCENE, "--passes", "none", "--frames", "2", "--display", "file", "-o", "out"),
         ["out/wall-r0c0.png", "out/wall-r0c1.png", "out/manifest.json"], {NO_RANK: ["alloc", *FILES]}),
    Case("wall of ranks", light("wall", "run", WALL, SCENE, "--passes", "none", "--frames", "2", "--display", "file", "-o", "out", "--ranks", "2",
                                "--hang-timeout", "20s"),
         ["out/wall-r0c0.png", "out/wall-r0c1.png", "out/manifest.json"],
         {NO_RANK: ["alloc", *FILES], "0": ["alloc", "mpi", *FILES], "1": ["alloc", "mpi", *FILES]}, quick=False),
    Case("remote", light("wall", "run", WALL, SCENE, "--passes", "none", "--frames", "2", "--display", "remote", "-o", "out"),
         ["out/manifest.json"], {NO_RANK: ["alloc", "socket"]}, display="run"),
    Case("display", light("wall", "run", WALL, SCENE, "--passes", "none", "--frames", "2", "--display", "remote", "-o", "out"),
         ["out/manifest.json"], {NO_RANK: ["alloc", "socket", *FILES]}, code=143, display="display"),
    # What is new here is how the error is made and printed.
    Case("refused", ["render", "none.glb", "-o", "x.png"], [], {NO_RANK: ["alloc"]}, code=4),
]


class Run:
    """One run of a case with one fault, in a folder that goes with it."""

    def __init__(self, case, kind, number, rank):
        self.case = case
        self.kind = kind
        self.faults = f"{kind}:{number}" + (f":{rank}" if rank else "")
        self.name = f"{case.name}, {self.faults}"
        with tempfile.TemporaryDirectory(prefix="hpr-faults-") as scratch:
            self.top = pathlib.Path(scratch)
            self.folder = self.top / "work"
            for name in ["work", "tmp", "cache", "run", "mpi"]:
                (self.top / name).mkdir(mode=0o700)
            met = self.top / "met"
            self.execute()
            self.left = self.processes_left(f"HPR_FAULTS_MET={met}".encode())
            self.met = met.read_bytes() if met.exists() else b""
            self.files = {str(p.relative_to(self.folder)): p.read_bytes() for p in sorted(self.folder.rglob("*")) if p.is_file()}
            kept = [p for name in ["tmp", "run"] for p in sorted((self.top / name).rglob("*")) if not p.is_dir()]
            self.temporary = [str(p.relative_to(self.top)) for p in kept]

    def environment(self, faulty):
        """Open MPI's own temporary files, which an aborted job leaves, are nobody's concern."""
        names = {"TMPDIR": "tmp", "HPR_CACHE": "cache", "XDG_RUNTIME_DIR": "run", "OMPI_MCA_orte_tmpdir_base": "mpi", "HPR_FAULTS_MET": "met"}
        return {**os.environ, **{variable: str(self.top / name) for variable, name in names.items()},
                **({"LD_PRELOAD": FAULTS, "HPR_FAULTS": self.faults} if faulty else {})}

    def start(self, arguments, faulty):
        return subprocess.Popen([HPR, *arguments], cwd=self.folder, env=self.environment(faulty), stdin=subprocess.DEVNULL,
                                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace")

    def execute(self):
        where = self.case.display
        display = None
        said = ""
        if where:
            display = self.start(["display", "--wall", WALL, "--host", "localhost", "-o", "shown"], where == "display")
            said = read_until(display, "listening on")
        run = self.start(self.case.arguments, where != "display")
        said_by_run = read_until(run, self.case.signal_after) if self.case.signal_after else ""
        if self.case.signal_after and run.poll() is None:
            run.send_signal(signal.SIGUSR1)
        self.code, self.stderr = end(run, said_by_run)
        self.other_code = None
        if display:
            if display.poll() is None:
                display.send_signal(signal.SIGTERM)
            self.other_code, said = end(display, said)
        if where == "display":
            self.code, self.other_code, self.stderr = self.other_code, self.code, said

    def processes_left(self, mark):
        """What still runs with this run's environment, once it has had time to leave; it is ended."""
        until = time.monotonic() + GONE
        while True:
            found = list(processes_with(mark))
            if not found or time.monotonic() > until:
                break
            time.sleep(0.05)
        for pid, _ in found:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        return [command for _, command in found]


def read_until(process, words):
    """What a process says until it says that, or ends."""
    said = ""
    for line in process.stderr:
        said += line
        if words in line:
            break
    return said


def end(process, said):
    """The code of a process that ends, None of one that does not; and all it said."""
    try:
        said += process.communicate(timeout=TIMEOUT)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        return None, said + process.communicate()[1]
    return process.returncode if process.returncode != -signal.SIGTERM else 143, said


def processes_with(mark):
    for each in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            if mark in (each / "environ").read_bytes().split(b"\0"):
                yield int(each.name), (each / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue


def is_complete(name, found, expected, is_last):
    """Whether a result is what it is without a fault, as far as two runs give the same. `is_last`: it cannot be that of an earlier frame."""
    if name.endswith(".json"):
        try:
            return json.loads(found).keys() == json.loads(expected).keys()
        except ValueError:
            return False
    if name.endswith(".csv"):
        return found.count(b"\n") == expected.count(b"\n") and found.endswith(b"\n")
    if name.endswith(".png") and not is_last:
        return len(png.decode(found)[2]) == len(png.decode(expected)[2])
    if name.endswith(".checkpoint"):
        return found[:8] == expected[:8] and len(found) == len(expected)
    return found == expected


def error_of(stderr):
    """The lines of the first error; mpiexec adds words of its own."""
    lines = stderr.splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("hpr: error:")]
    if not starts:
        return []
    rest = lines[starts[0] + 1:]
    follow = next((i for i, line in enumerate(rest) if not line.startswith("  ")), len(rest))
    return lines[starts[0]:starts[0] + 1 + follow]


def findings_of(run, normal):
    """What is wrong with a run that met its fault."""
    case = run.case
    codes, words = OUTCOMES[run.kind]
    allowed = (codes - {0}) | ({case.code} | case.other_ends if 0 in codes else set())
    if run.code is None:
        yield f"does not end within {TIMEOUT} s"
    elif run.code not in allowed:
        yield f"leaves with {run.code}, not {sorted(allowed)}"
    if case.display and run.other_code not in (normal.other_code, 0, 7):
        yield f"the other process leaves with {run.other_code}"
    failed = run.code not in {case.code} | case.other_ends
    for name, content in run.files.items():
        if name in case.other_results and run.code in case.other_ends:
            png.decode(content)
        elif name not in normal.files:
            yield f"leaves '{name}'"
        elif not is_complete(name, content, normal.files[name], run.code == 0 and not case.display):
            yield f"leaves '{name}', which is not complete ({len(content)} bytes of {len(normal.files[name])})"
    for name in case.results:
        if run.code == case.code and name not in run.files:
            yield f"leaves with {run.code} and without '{name}'"
    for name in run.temporary:
        yield f"leaves a temporary file, '{name}'"
    for command in run.left:
        yield f"leaves a process: {command}"
    if not failed or run.code is None:
        return
    error = error_of(run.stderr)
    if not error or len(error) > 3:
        yield f"has an error of {len(error)} lines"
    elif not any(word in run.stderr for word in words):
        yield f"has an error that does not name its cause, none of {words}"


def numbers_of(case, kind, rank, known):
    """Which calls of a kind are to fail: the first from each place that is not known, or a sample of them."""
    places = dict(struct.iter_unpack("<QQ", Run(case, kind, 0, rank).met))
    numbers = sorted(number for place, number in places.items() if (kind, rank, place) not in known)
    known.update((kind, rank, place) for place in places)
    chosen = random.Random(f"{SEED} {case.name} {kind} {rank}")
    return sorted(chosen.sample(numbers, min(MOST, len(numbers))))


def one_by_one(case, kind, rank):
    """A run for each call of a kind: the last one meets no fault."""
    number = 1
    while (run := Run(case, kind, number, rank)).met:
        yield run
        number += 1


def main():
    names = [a for i, a in enumerate(sys.argv[3:], 3) if not a.startswith("--") and sys.argv[i - 1] not in ("--seed", "--most")]
    cases = [case for case in CASES if (case.name in names if names else FULL or case.quick)]
    met = 0
    known = set()
    with concurrent.futures.ThreadPoolExecutor(max(2, min(os.cpu_count() or 1, 8))) as pool:
        for case in cases:
            normal = Run(case, "none", 1, NO_RANK)
            if normal.code != case.code or set(case.results) - set(normal.files):
                failures.append(case.name)
                print(f"{case.name}: leaves with {normal.code} and {sorted(normal.files)} without a fault:\n{normal.stderr[-1500:]}")
                continue
            points = [(kind, rank) for rank, kinds in case.swept.items() for kind in kinds]
            of_files = pool.map(lambda point: list(one_by_one(case, *point)), [p for p in points if p[0] in FILES])
            points = [p for p in points if p[0] not in FILES]
            numbers = pool.map(lambda point: numbers_of(case, *point, known), points)
            faults = [(kind, number, rank) for (kind, rank), all_of in zip(points, numbers) for number in all_of]
            outcomes = {}
            for run in itertools.chain(*of_files, pool.map(lambda fault: Run(case, *fault), faults)):
                if not run.met:
                    continue
                met += 1
                outcomes.setdefault((run.kind, run.code), []).append(run)
                for finding in findings_of(run, normal):
                    failures.append(run.name)
                    print(f"{run.name}: {finding}\n  at {run.met.decode().split()}\n  stderr: {run.stderr[-800:]!r}", flush=True)
            print(f"{case.name}: " + ", ".join(f"{kind} {len(runs)} x {code}" for (kind, code), runs in sorted(outcomes.items(), key=str)), flush=True)
    print(f"{met} faults were met, {len(set(failures))} with findings")
    if met == 0:
        failures.append("no fault was met")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
