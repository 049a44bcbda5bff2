#!/usr/bin/env python3
"""`hpr wall script --slurm`: the script runs the wall, with stand-ins for srun and scontrol that start everything on this machine.

usage: wall_script_test.py HPR

The hosts of the wall are addresses of the loopback, so that displays are reached over TCP as across machines.
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

import png
from processes import send, words_of
from program import HPR, expect, failures, run
from xxh64 import xxh64

HOSTS = ["127.0.0.1", "127.0.0.2"]
SRUN = """#!/bin/bash
# Starts one task here, or all tasks of a step of several ranks under mpiexec.
echo "srun $*" >>"$FAKE_LOG"
tasks=1
for word in "$@"; do
  [[ $word == --ntasks=* ]] && tasks=${word#--ntasks=}
done
mpi=$1
while [[ $1 == --* ]]; do shift; done
if [[ $mpi != --mpi=pmix ]]; then exec "$@"; fi
cp "$SLURM_HOSTFILE" "$FAKE_LOG.hosts"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
export OMPI_MCA_hwloc_base_binding_policy=none OMPI_MCA_mpi_yield_when_idle=1
mpiexec -n "$tasks" "$@" &
echo $! >"$FAKE_LOG.step"
code=0
wait $! || code=$?
# Ranks that leave after the first one with a code are killed, and the highest code is the step's.
[[ $code == 75 ]] && code=137
exit "$code"
"""
SCONTROL = """#!/bin/bash
echo "scontrol $*" >>"$FAKE_LOG"
"""


def free_ports():
    """A port of all addresses whose successor is free too."""
    for first in range(21000, 32000, 7):
        try:
            for port in (first, first + 1):
                with socket.create_server(("0.0.0.0", port)):
                    pass
            return first
        except OSError:
            continue
    raise RuntimeError("no free ports")


class Job:
    """A batch job: the script by bash, as Slurm runs it."""

    def __init__(self, folder, script, number="4711"):
        self.log = folder / "fake.log"
        tools = folder / "tools"
        tools.mkdir(exist_ok=True)
        for name, text in (("srun", SRUN), ("scontrol", SCONTROL)):
            (tools / name).write_text(text)
            (tools / name).chmod(0o755)
        environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "HPR": HPR, "FAKE_LOG": str(self.log),
                       "SLURM_JOB_ID": number, "HPR_PORT": str(free_ports()), "XDG_RUNTIME_DIR": str(folder)}
        self.out = folder / f"wall-{number}"
        self.words = open(folder / "job.log", "a+", encoding="utf-8")
        self.process = subprocess.Popen(["bash", str(script)], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                        stdout=self.words, stderr=subprocess.STDOUT)

    def leave(self):
        try:
            return self.process.wait(timeout=120)
        finally:
            self.process.kill()
            self.words.close()

    def said(self):
        return pathlib.Path(self.words.name).read_text(encoding="utf-8")[-3000:]

    def calls(self):
        return self.log.read_text()

    def manifest(self):
        return json.loads((self.out / "manifest.json").read_text())


def write(folder, *options):
    made = run(folder, "wall", "script", "wall.toml", "--slurm", "gen:gallery", "--show", "file", *options)
    expect(made.returncode == 0, f"the script is not written: {made.stderr}")
    script = folder / "wall.sbatch"
    script.write_text(made.stdout)
    sound = subprocess.run(["bash", "-n", str(script)], capture_output=True, text=True, check=False)
    expect(sound.returncode == 0 and sound.stderr == "", f"bash -n: {sound.stderr}")
    return made.stdout


def check_text(folder):
    text = write(folder, "--frames", "3", "--time", "8:00:00")
    for line in ("#SBATCH --nodes=2", "#SBATCH --nodelist=127.0.0.1,127.0.0.2", "#SBATCH --ntasks-per-node=2",
                 "#SBATCH --signal=USR1@60", "#SBATCH --time=8:00:00"):
        expect(f"\n{line}\n" in text, f"the script has no {line}:\n{text}")
    expect("--kill-on-bad-exit" in text and "--launcher \"srun --mpi=pmix" in text, "the ranks' srun")
    draws_only = (folder / "wall.toml").read_text().replace("nodes = [", 'nodes = [{ id = "r", host = "big", ranks = 3 },')
    (folder / "more.toml").write_text(draws_only)
    more = run(folder, "wall", "script", "more.toml", "--slurm").stdout
    for line in ("#SBATCH --nodes=3", "#SBATCH --ntasks-per-node=3", 'scene=${1:?name a scene: sbatch SCRIPT SCENE}'):
        expect(f"\n{line}\n" in more, f"with a node that only draws, no {line}:\n{more}")
    expect("ranks=(big big big 127.0.0.1 127.0.0.1 " in more and "displays=(127.0.0.1 127.0.0.2)" in more, more)
    expect("requeue" not in write(folder).replace("#SBATCH --requeue", ""), "requeues what never leaves with 75")


def check_run(folder):
    """Every screen shows, on the display of its host, what a run without Slurm draws."""
    write(folder, "--frames", "40")
    job = Job(folder, folder / "wall.sbatch")
    code = job.leave()
    if not expect(code == 0, f"the job left with {code}:\n{job.said()}"):
        return
    frames = job.manifest()["frames"]
    expect(len(frames) == 40, f"{len(frames)} frames")
    expect((folder / "fake.log.hosts").read_text().split() == ["127.0.0.1"] * 2 + ["127.0.0.2"] * 2, "ranks on other hosts")
    direct = run(folder, "wall", "run", "wall.toml", "gen:gallery", "--frames", "40", "-o", "direct", "-q")
    expect(direct.returncode == 0, f"{direct.stderr}")
    screens = frames[-1]["screens"]
    alone = json.loads((folder / "direct" / "manifest.json").read_text())["frames"][-1]["screens"]
    expect([s["xxh64"] for s in screens] == [s["xxh64"] for s in alone], "another picture than without Slurm")
    expect(len({screen["xxh64"] for screen in screens}) == 4, "the screens show the same")
    for number, screen in enumerate(screens):
        shown = job.out / HOSTS[number // 2] / f"{screen['id']}.png"
        same = shown.exists() and xxh64(png.decode(shown.read_bytes())[2]) == screen["xxh64"]
        expect(same, f"{shown} does not show the last frame")
    expect("token" not in job.calls().lower(), "the token is on a command line")
    expect("scontrol" not in job.calls(), "requeued though it was done")
    left = subprocess.run(["pgrep", "-f", str(job.out)], capture_output=True, text=True, check=False).stdout
    expect(left == "", f"processes are left: {left}")


def check_time_limit(folder):
    """USR1 to all steps, as a minute before the time is up: requeued, and the next job goes on with the next frame."""
    write(folder, "--frames", "150")
    (folder / "fake.log").unlink(missing_ok=True)
    (folder / "fake.log.step").unlink(missing_ok=True)
    job = Job(folder, folder / "wall.sbatch", "4712")
    until = time.monotonic() + 60
    status = job.out / HOSTS[0] / "display.json"
    shown = None
    while time.monotonic() < until and not shown and job.process.poll() is None:
        if status.exists():
            shown = json.loads(status.read_text())["screens"][0]["frame"]
        time.sleep(0.05)
    if not expect(shown, f"nothing was shown:\n{job.said()}"):
        job.process.kill()
        return
    os.kill(int((folder / "fake.log.step").read_text()), signal.SIGUSR1)
    for pid in subprocess.run(["pgrep", "-f", f" display --wall .*{job.out}"], capture_output=True, text=True, check=False).stdout.split():
        if int(pid) != job.process.pid:
            if words_of(pid, "cmdline").startswith(HPR.encode()):
                send(int(pid), signal.SIGUSR1)
    code = job.leave()
    expect(code == 0, f"the stopped job left with {code}:\n{job.said()}")
    expect("scontrol requeue 4712" in job.calls(), f"not requeued:\n{job.calls()}\n{job.said()}")
    expect(job.calls().count("display --wall") == 2, f"displays were started again:\n{job.calls()}")
    before = job.manifest()
    done = len(before["frames"])
    expect(before.get("stopped") == {"frames": done, "of": 150} and 0 < done < 150, f"stopped: {before.get('stopped')}")
    again = Job(folder, folder / "wall.sbatch", "4712")
    code = again.leave()
    expect(code == 0, f"the second job left with {code}:\n{again.said()}")
    frames = again.manifest()["frames"]
    expect([frame["frame"] for frame in frames] == list(range(150)), f"{len(frames)} frames")
    expect(frames[:done] == before["frames"], "what was done before the requeue is written otherwise now")
    expect("stopped" not in again.manifest(), "still called stopped")


def check_errors(folder):
    for arguments, words in ((["2x1"], "has no nodes"), (["elsewhere.toml"], "does not know a host 'localhost'"),
                             (["wall.toml", "--time", "1h; reboot"], "no time of Slurm's"),
                             (["wall.toml", "--show", "widnow"], "did you mean 'window'")):
        done = run(folder, "wall", "script", *arguments, "--slurm")
        expect(done.returncode == 2 and words in done.stderr, f"{arguments}: {done.returncode}, {done.stderr}")
    expect(run(folder, "wall", "script", "wall.toml").returncode == 2, "no --slurm, and no error")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-wall-script-") as scratch:
        folder = pathlib.Path(scratch)
        made = run(folder, "wall", "init", "--cols", "2", "--rows", "2", "--hosts", "127.0.0.[1-2]", "--tiles-per-host", "2",
                   "--ranks-per-host", "2", "--tile-pixels", "64x48", "-o", "wall.toml")
        expect(made.returncode == 0, f"{made.stderr}")
        (folder / "elsewhere.toml").write_text((folder / "wall.toml").read_text().replace('host = "127.0.0.2"', 'host = "localhost"'))
        for check in (check_text, check_run, check_time_limit, check_errors):
            check(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
