#!/usr/bin/env python3
"""What becomes of a job that hpr starts when its output is not taken, or a signal comes.

usage: job_test.py HPR

Prints what was wrong and leaves with 1.
"""

import json
import os
import pathlib
import pty
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from processes import children_of, ranks_of, send, wait_gone, words_of
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


ENDING = "hpr: ending; Ctrl-C again ends it at once"


def announced(folder):
    """That a signal was heard is said at once and once, by the launcher or by a run that comes to an orderly end; not by
    one that says errors only."""
    endless = ["wall", "run", "2x1@64x48", "gen:cornell", "--quality", "draft", "--passes", "none", "--display", "none"]
    render = ["render", "gen:gallery", "-o", "announced.png", "--spp", "1000000", "--photons", "1000", "--progress", "none"]
    for case, arguments, number, spoken in (("render", [*render, "--ranks", "2"], signal.SIGINT, True),
                                            ("render, told to end", [*render, "--ranks", "2"], signal.SIGTERM, True),
                                            ("quiet", [*render, "--ranks", "2", "-q"], signal.SIGINT, False),
                                            ("wall", [*endless, "--until-stopped"], signal.SIGINT, True),
                                            ("wall, two ranks", [*endless, "--until-stopped", "--ranks", "2"], signal.SIGINT, True)):
        run = subprocess.Popen([HPR, *arguments], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
        until = time.monotonic() + 60
        while run.poll() is None and time.monotonic() < until:
            processes = ranks_of(run.pid) if "--ranks" in arguments else [run.pid]
            if processes and all(has_begun(process) or catches(process, number) for process in processes):
                break
            time.sleep(0.02)
        time.sleep(1)
        run.send_signal(number)
        begin = time.monotonic()
        said = b""
        while ENDING.encode() not in said and (more := os.read(run.stderr.fileno(), 4096)):
            said += more
        after = time.monotonic() - begin
        said = (said + run.communicate(timeout=60)[1]).decode()
        expect(said.count(ENDING) == (1 if spoken else 0), f"{case}: an end is not announced as it should: {said[-600:]}")
        expect(not spoken or after < 3.0, f"{case}: an end is announced after {after:.2f} s")  # 0.1 s where nothing else runs
        expect(run.returncode == (0 if "wall" in case else -number), f"{case}: left with {run.returncode}: {said[-600:]}")


def mpi_files(pids):
    """What MPI and the launcher keep outside the job's own memory: of these processes' open files and maps."""
    found = set()
    for pid in pids:
        for line in words_of(pid, "maps").decode().splitlines():
            if line.partition("/")[2].startswith("dev/shm/") and "deleted" not in line:
                found.add("/" + line.partition("/")[2])
    return found


def swept(folder):
    """What a killed mpiexec, or a whole job that is killed, leaves is gone after the next job; a living one's is not."""
    temporary = folder / "temporary"
    temporary.mkdir()
    environment = plain_environment(TMPDIR=str(temporary))
    command = [HPR, "render", "gen:gallery", "--spp", "1000000", "--photons", "1000", "--progress", "none", "--ranks", "2", "-o"]
    jobs = [subprocess.Popen([*command, f"swept{i}.png"], cwd=folder, env=environment, stderr=subprocess.DEVNULL) for i in range(3)]
    until = time.monotonic() + 60
    files = []
    for job in jobs:
        while job.poll() is None and time.monotonic() < until and not (len(ranks_of(job.pid)) == 2 and mpi_files(ranks_of(job.pid))):
            time.sleep(0.05)
        files.append(mpi_files(ranks_of(job.pid)))
        expect(files[-1], "a job of two ranks shares no memory")
    killed, lone, living = jobs
    everybody = [pid for job in (killed, lone) for pid in (*children_of(job.pid), *ranks_of(job.pid))]
    for pid in [killed.pid, *children_of(killed.pid), *ranks_of(killed.pid), *children_of(lone.pid)]:
        send(pid, signal.SIGKILL)
    for job in (killed, lone):
        job.wait(timeout=60)
    for pid in everybody:
        expect(wait_gone(pid), f"{pid} outlives its job")
    expect(lone.returncode == 7, f"a job whose mpiexec was killed left with {lone.returncode}")
    expect(len(list(temporary.iterdir())) in (2, 3), f"three jobs have {list(temporary.iterdir())}")
    result = subprocess.run([HPR, "render", "gen:cornell", "-o", "next.png", "--size", "32x24", "--ranks", "2"], cwd=folder,
                            env=environment, capture_output=True, text=True, timeout=60, check=False)
    expect(result.returncode == 0, f"the next job left with {result.returncode}: {result.stderr}")
    for path in files[0] | files[1]:
        expect(not os.path.exists(path), f"{path} of a dead job is there")
    for path in files[2]:
        expect(os.path.exists(path), f"{path} of a living job is gone")
    expect(len(list(temporary.iterdir())) == 1, f"one job has {list(temporary.iterdir())}")
    living.terminate()
    living.wait(timeout=60)
    expect(not list(temporary.iterdir()), f"jobs that have ended leave {list(temporary.iterdir())}")
    for path in files[2]:
        expect(not os.path.exists(path), f"{path} of a job that ended is there")


def stopped(folder, ranks):
    """SIGUSR1 is an orderly end before all frames are done: what was drawn is written down."""
    name = f"stopped-{ranks}"
    run = started(folder, name, ranks)
    run.send_signal(signal.SIGUSR1)
    said = run.communicate(timeout=60)[1].decode()
    expect(run.returncode == 75, f"{name}: left with {run.returncode}:\n{said[-1500:]}")
    frames = json.loads((folder / name / "manifest.json").read_text())["frames"]
    expect(len(frames) >= 2, f"{name}: {len(frames)} frames are written down")


def colors(folder):
    """For a terminal somebody looks at: the one mpirun gives rank 0 ends in a file, or anywhere."""
    alone = {name: value for name, value in os.environ.items() if name != "NO_COLOR"}
    for environment, wanted in ((alone, True), ({**alone, "OMPI_COMM_WORLD_SIZE": "1", "OMPI_COMM_WORLD_RANK": "0"}, False)):
        ours, theirs = pty.openpty()
        run = subprocess.Popen([HPR, "doctor"], cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=theirs,
                               stderr=subprocess.DEVNULL)
        os.close(theirs)
        said = b""
        try:
            while more := os.read(ours, 65536):
                said += more
        except OSError:  # how its end is told
            pass
        run.wait(timeout=60)
        os.close(ours)
        expect((b"\x1b[" in said) == wanted and b"temporary files" in said, f"doctor {'alone' if wanted else 'in a job'}: {said[:400]}")


def doctor_starts_a_job(folder):
    fake = folder / "fake"
    fake.mkdir()
    (fake / "mpiexec").write_text("#!/bin/sh\nexit 1\n")
    (fake / "mpiexec").chmod(0o755)
    for path, status, mention in ((os.environ["PATH"], "ok", "2 ranks start"),
                                  (f"{fake}{os.pathsep}{os.environ['PATH']}", "warn", "only one rank can run")):
        told = subprocess.run([HPR, "doctor", "--json"], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True,
                              timeout=120, check=False)
        found = {finding["name"]: finding for finding in json.loads(told.stdout)["findings"]}.get("MPI job", {})
        expect(found.get("status") == status and mention in found.get("detail", ""), f"doctor: {found}, {told.stderr}")


def has_begun(pid):
    """Whether a process is past its start: it has threads of its own."""
    try:
        return len(list(pathlib.Path(f"/proc/{pid}/task").iterdir())) > 1
    except OSError:
        return False


def catches(pid, number):
    """Whether a process has a handler for a signal."""
    caught = re.search(rb"^SigCgt:\s*([0-9a-f]+)", words_of(pid, "status"), re.MULTILINE)
    return bool(caught) and bool(int(caught[1], 16) >> (number - 1) & 1)


def asked_in_vain(folder):
    """SIGUSR1 and SIGUSR2 are nothing to commands without a checkpoint, nor to their ranks."""
    for ranks in (1, 2):
        where = ["--ranks", "2"] if ranks > 1 else ["--transport", "threads"]
        run = subprocess.Popen([HPR, "compare", "--synthetic", "dense", "--size", "640x480", "--strategies", "serial", "--frames",
                                "400", *where], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        asked, until = [], time.monotonic() + 60
        while run.poll() is None and time.monotonic() < until and not asked:
            time.sleep(0.02)
            processes = ranks_of(run.pid) if ranks > 1 else [run.pid]
            if len(processes) == ranks and all(map(has_begun, processes)):
                asked = [run.pid, *processes]
        for process in asked:
            for number in (signal.SIGUSR1, signal.SIGUSR2):
                send(process, number)
        said = run.communicate(timeout=60)[1].decode()
        expect(asked, f"{ranks} ranks: were not seen to begin")
        expect(run.returncode == 0, f"{ranks} ranks: asked in vain, left with {run.returncode}:\n{said[-1500:]}")


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


def stubborn(folder):
    """A mpiexec that neither starts ranks nor ends when it is told to: an environment that finds it, and a file with the
    numbers of its processes, one in a group of its own as ranks are."""
    script = folder / "stubborn" / "mpiexec"
    script.parent.mkdir(exist_ok=True)
    script.write_text(f"#!/bin/sh\ntrap '' TERM INT\nsetsid sleep 300 &\necho $$ $! > {folder}/stubborn/pids\n"
                      "while :; do sleep 1; done\n")
    script.chmod(0o755)
    return {**os.environ, "PATH": f"{script.parent}:{os.environ['PATH']}"}, script.parent / "pids"


def runs(pid):
    try:
        state = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state not in "ZX"  # who reaps an orphan is not ours to say


def expect_gone(case, pids):
    left = [pid for pid in map(int, pids.read_text().split()) if runs(pid)]
    expect(not left, f"{case}: processes {left} are left")
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    pids.unlink()


def limits_of_a_stubborn_mpiexec(folder):
    environment, pids = stubborn(folder)
    for case, number, limit in (("ranks that never start", None, "1s"), ("SIGTERM", signal.SIGTERM, "2s"),
                                ("SIGINT", signal.SIGINT, "2s")):
        with open(folder / "said", "w+", encoding="utf-8") as said:
            run = subprocess.Popen([HPR, "render", "gen:cornell", "-o", "stubborn.png", "--size", "32x24", "--passes", "none",
                                    "--ranks", "2", "--hang-timeout", limit], cwd=folder, env=environment, stderr=said)
            while run.poll() is None and not (pids.exists() and pids.read_text()):
                time.sleep(0.02)
            if number:
                run.send_signal(number)
            try:
                run.wait(timeout=9 if number else 30)
            except subprocess.TimeoutExpired:
                run.kill()
                run.wait()
            said.seek(0)
            message = said.read()
        expect(run.returncode == (-number if number else 4), f"{case}: left with {run.returncode}: {message}")
        expect(bool(number) or ("has not started 2 ranks" in message and "--hang-timeout" in message), f"{case}: says {message}")
        expect_gone(case, pids)


def plain_environment(**more):
    """Without what this test's own job says about Open MPI and Slurm."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_", "SLURM_", "PMI"))}
    return {**kept, **more}


def without_ssh(folder):
    """A job of one host needs no ssh: Open MPI's launcher of other hosts ends by a signal where there is none."""
    programs = folder / "programs"
    programs.mkdir()
    for name in ("mpiexec", "orted"):
        (programs / name).symlink_to(shutil.which(name))
    left = subprocess.run([HPR, "render", "gen:cornell", "-o", "alone.png", "--size", "32x24", "--ranks", "2"], cwd=folder,
                          env=plain_environment(PATH=str(programs)), capture_output=True, text=True, timeout=60, check=False)
    expect(left.returncode == 0, f"two ranks without ssh left with {left.returncode}: {left.stderr}")


def open_to_the_network(pids):
    """The TCP ports of these processes that are not only this host's."""
    sockets = set()
    for pid in pids:
        for file in pathlib.Path(f"/proc/{pid}/fd").iterdir():
            try:
                sockets.add(os.readlink(file))
            except OSError:
                continue
    found = []
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in pathlib.Path(table).read_text().splitlines()[1:]:
            fields = line.split()
            listens = fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets
            if listens and not fields[1].startswith(("0100007F:", "00000000000000000000000001000000:")):
                found.append(fields[1])
    return found


def ranks_that_listen(folder):
    """The ranks of a job of one host take no connections of other hosts."""
    run = subprocess.Popen([HPR, *WALL, "-o", "quiet", "--keep-frames", "--ranks", "2"], cwd=folder, env=plain_environment(),
                           stderr=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while not (folder / "quiet" / "frame-000002").exists() and run.poll() is None and time.monotonic() < until:
        time.sleep(0.02)
    ranks = ranks_of(run.pid)
    expect(len(ranks) == 2, f"ranks of a wall: {ranks}")
    listening = open_to_the_network(ranks)
    expect(not listening, f"ranks listen to the network at {listening}")
    run.terminate()
    run.wait(timeout=30)


def lone_tasks(folder):
    """srun without MPI's help starts whole runs, which would write over each other's files."""
    for task, ranks in (("0", []), ("1", ["--ranks", "2"])):
        left = subprocess.run([HPR, "render", "gen:cornell", "-o", "lone.png", "--size", "32x24", *ranks], cwd=folder,
                              env=plain_environment(SLURM_NTASKS="2", SLURM_PROCID=task, SLURM_STEP_ID="0"),
                              capture_output=True, text=True, timeout=60, check=False)
        expect(left.returncode == 2, f"task {task} of 2 without MPI left with {left.returncode}: {left.stderr}")
        expect("srun --mpi=pmix -n 2" in left.stderr, f"task {task} of 2 says {left.stderr}")
        expect(not (folder / "lone.png").exists(), f"task {task} of 2 wrote its picture")
    script = subprocess.run([HPR, "render", "gen:cornell", "-o", "lone.png", "--size", "32x24"], cwd=folder,
                            env=plain_environment(SLURM_NTASKS="2", SLURM_PROCID="0", SLURM_JOB_ID="1"),
                            capture_output=True, text=True, timeout=60, check=False)
    expect(script.returncode == 0, f"a batch script of two tasks left with {script.returncode}: {script.stderr}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-job-") as scratch:
        folder = pathlib.Path(scratch)
        for ranks in (1, 2):
            output_nobody_takes(folder, ranks)
            stopped(folder, ranks)
            interrupted(folder, ranks, signal.SIGTERM, False)
        announced(folder)
        swept(folder)
        without_ssh(folder)
        doctor_starts_a_job(folder)
        ranks_that_listen(folder)
        lone_tasks(folder)
        asked_in_vain(folder)
        colors(folder)
        ignored(folder)
        limits_of_a_stubborn_mpiexec(folder)
        interrupted(folder, 2, signal.SIGINT, False)
        interrupted(folder, 2, signal.SIGINT, True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
