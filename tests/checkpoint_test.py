#!/usr/bin/env python3
"""Runs that are interrupted: SIGUSR1 writes a checkpoint and stops with 75, SIGUSR2 writes one and goes on, and a run
that is resumed, by any number of ranks, ends with the bits of one that was not interrupted.

usage: checkpoint_test.py HPR

Runs that are killed at random times go on from what they wrote by the clock, and so do those whose newest checkpoint is
lost. Signals go to hpr itself, which passes them to its mpiexec, and to a single rank of a job of several. Prints what is
wrong and leaves with 1.
"""

import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import processes
from program import HPR, expect, failures

SAMPLES = 64
COMMON = ["--progress", "line", "--threads", "1", "--photons", "1000"]
ARGUMENTS = ["render", "gen:gallery", "--size", "96x64", *COMMON]


def run(folder, *arguments):
    return subprocess.run([HPR, *ARGUMENTS, *arguments], cwd=folder, capture_output=True, text=True, timeout=300,
                          check=False)


def last_rank_of(pid):
    """A rank of the job that `pid` started: the youngest child of its mpiexec."""
    return processes.ranks_of(pid)[-1]


def interrupt(folder, wanted, target, *arguments, after=12):
    """Starts hpr and sends it `wanted` once `after` samples are done. Returns its code, its stderr, and the samples that
    were done when the signal went out."""
    process = subprocess.Popen([HPR, *ARGUMENTS, *arguments], cwd=folder, stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
    lines = []
    done = None
    for line in process.stderr:
        lines.append(line)
        if done is None and line.startswith("hpr: sample ") and int(line.split()[2].split("/")[0]) >= after:
            done = int(line.split()[2].split("/")[0])
            os.kill(target(process.pid), wanted)
    return process.wait(timeout=300), "".join(lines), done


def samples_in(message):
    for line in message.splitlines():
        if " samples are in " in line:
            return int(line.split(" samples are in ")[0].split()[-1])
    return None


def itself(pid):
    return pid


def stop_and_resume(folder, whole, case, target, before, after, at=12):
    code, message, sent_at = interrupt(folder, signal.SIGUSR1, target, "-o", "a.exr", "--spp", str(SAMPLES), *before, after=at)
    expect(code == 75, f"{case}: left with {code} instead of 75: {message[-800:]}")
    expect(not (folder / "a.exr").exists(), f"{case}: stopped, but wrote a picture")
    stopped_at = samples_in(message)
    expect(stopped_at is not None and sent_at <= stopped_at < SAMPLES, f"{case}: sent at {sent_at}, stopped at {stopped_at}")
    if not (folder / "a.exr.checkpoint").exists():
        expect(False, f"{case}: no checkpoint")
        return
    result = run(folder, "-o", "a.exr", "--spp", str(SAMPLES), "--resume", *after)
    expect(result.returncode == 0, f"{case}: resuming left with {result.returncode}: {result.stderr[-800:]}")
    expect(f"after {stopped_at} samples" in result.stderr, f"{case}: does not say where it goes on")
    expect(f"hpr: sample {stopped_at} " not in result.stderr, f"{case}: drew samples again")
    same = (folder / "a.exr").exists() and (folder / "a.exr").read_bytes() == whole
    expect(same, f"{case}: other bits than a run without a break")
    for name in ("a.exr", "a.exr.checkpoint"):
        (folder / name).unlink(missing_ok=True)


def write_and_go_on(folder, whole):
    code, message, _ = interrupt(folder, signal.SIGUSR2, itself, "-o", "b.exr", "--spp", str(SAMPLES),
                                 "--checkpoint", "b.state")
    expect(code == 0, f"USR2: left with {code}: {message[-800:]}")
    expect((folder / "b.exr").read_bytes() == whole, "USR2: other bits than a run without a break")
    written_at = samples_in(message)
    state = folder / "b.state"
    expect(written_at is not None and state.exists(), "USR2: no checkpoint")
    return state


def as_soon_as_mpi_starts(folder):
    """mpiexec has no ear for signals yet, and ranks would die of them: they wait until all have started."""
    for wanted, code, name, samples in ((signal.SIGUSR1, 75, "USR1", "1000"), (signal.SIGUSR2, 0, "USR2", str(SAMPLES))):
        process = subprocess.Popen([HPR, *ARGUMENTS, "-o", "j.exr", "--spp", samples, "--ranks", "2"], cwd=folder,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while process.poll() is None and not processes.children_of(process.pid):
            pass
        process.send_signal(wanted)
        said, message = process.communicate(timeout=300)
        expect(process.returncode == code, f"{name} at once: left with {process.returncode} instead of {code}: {message[-800:]}")
        expect(message.count("samples are in") == 1, f"{name} at once: not one checkpoint: {message[-800:]}")
        expect("started" not in said, f"{name} at once: {said!r} on standard output")
        for file in ("j.exr", "j.exr.checkpoint"):
            (folder / file).unlink(missing_ok=True)


def refusals(folder, state):
    resume = ["--resume", "--checkpoint", state.name, "-o", "c.exr"]
    scene, size = ["gen:gallery"], ["--size", "96x64"]
    foreign = {"scene": ["gen:cornell", *size], "seed": [*scene, *size, "--seed", "2"], "view": [*scene, "--size", "95x64"],
               "filter": [*scene, *size, "--filter", "gaussian"], "view 0": [*scene, *size, "--fov", "30"],
               "passes": [*scene, *size, "--passes", "none"], "--max-depth": [*scene, *size, "--max-depth", "3"],
               "--aov": [*scene, *size, "--aov", "id"], "adaptive": [*scene, *size, "--adaptive"],
               "--denoise": [*scene, *size, "--denoise"], "--raw": [*scene, *size, "--raw", "c.keys"]}
    for field, arguments in foreign.items():
        result = subprocess.run([HPR, "render", *arguments, *COMMON, "--spp", "20", *resume], cwd=folder,
                                capture_output=True, text=True, timeout=300, check=False)
        expect(result.returncode == 3 and "another run" in result.stderr and field in result.stderr,
              f"another {field}: left with {result.returncode}: {result.stderr}")
    whole = bytearray(state.read_bytes())
    whole[len(whole) // 2] ^= 1
    (folder / "damaged").write_bytes(whole)
    for ranks in ("1", "2"):
        result = run(folder, "--spp", str(SAMPLES), "--resume", "--checkpoint", "damaged", "-o", "c.exr", "--ranks", ranks)
        expect(result.returncode == 3 and "damaged" in result.stderr, f"damaged, {ranks} ranks: {result.returncode}")
    result = run(folder, "--spp", "20", "--resume", "--checkpoint", "none", "-o", "c.exr")
    expect(result.returncode == 4, f"no checkpoint: left with {result.returncode}")
    result = run(folder, "--spp", "20", "-o", "c.exr", "--checkpoint", state.name)
    expect(result.returncode == 4 and "--force" in result.stderr, f"checkpoint in the way: left with {result.returncode}")
    expect(not (folder / "c.exr").exists(), "a refused run wrote a picture")


def enough_samples(folder):
    """A checkpoint that has all that is asked for."""
    layers = ["--aov", "depth,id"]
    code, message, _ = interrupt(folder, signal.SIGUSR1, itself, "-o", "e.exr", "--spp", "1000000", *layers)
    expect(code == 75, f"a million samples: left with {code}")
    stopped_at = samples_in(message)
    result = run(folder, "-o", "e.exr", "--spp", str(stopped_at), "--resume", *layers)
    expect(result.returncode == 0, f"resuming at the goal: left with {result.returncode}: {result.stderr[-800:]}")
    if stopped_at > 1:
        fewer = run(folder, "-o", "g.exr", "--spp", str(stopped_at - 1), "--resume", "--checkpoint", "e.exr.checkpoint", *layers)
        expect(fewer.returncode == 3 and "more than" in fewer.stderr, f"fewer samples than there are: {fewer.returncode}: {fewer.stderr}")
    result = run(folder, "-o", "f.exr", "--spp", str(stopped_at), "--ranks", "2", *layers)
    expect((folder / "e.exr").read_bytes() == (folder / "f.exr").read_bytes(), "a checkpoint at its goal gives other bits")


def by_what_was_chosen_before(folder):
    """A choice that is measured may be another one the next time."""
    for chosen in ("rays", "raster"):
        code, message, _ = interrupt(folder, signal.SIGUSR1, itself, "-o", "h.exr", "--spp", "1000000", "--primary", chosen)
        expect(code == 75, f"--primary {chosen}: left with {code}")
        goal = str(samples_in(message) + 1)
        result = run(folder, "-o", "h.exr", "--spp", goal, "--resume", "--primary", "auto")
        expect(result.returncode == 0, f"--primary auto after {chosen}: left with {result.returncode}: {result.stderr[-800:]}")
        for name in ("h.exr", "h.exr.checkpoint"):
            (folder / name).unlink(missing_ok=True)


def nowhere_to_write(folder, whole):
    """Samples that can't be put down are not lost as well."""
    (folder / "gone").mkdir()

    def without_its_folder(pid):
        shutil.rmtree(folder / "gone")
        return pid

    code, message, _ = interrupt(folder, signal.SIGUSR2, without_its_folder, "-o", "i.exr", "--spp", str(SAMPLES),
                                 "--checkpoint", "gone/i.state")
    expect(code == 0 and "going on without" in message, f"no folder for USR2: left with {code}: {message[-800:]}")
    expect((folder / "i.exr").exists() and (folder / "i.exr").read_bytes() == whole, "no folder for USR2: other bits")


def start(folder, *arguments):
    """A run that writes checkpoints by the clock."""
    return subprocess.Popen([HPR, *ARGUMENTS, "--spp", str(SAMPLES), "--checkpoint-every", "0.2s", *arguments], cwd=folder,
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def generations(folder, name):
    """What is there of a checkpoint: the times of both files. Of a run under way, one may be renamed between two looks."""
    times = {}
    for path in folder.glob(f"{name}*"):
        try:
            times[path.name] = path.stat().st_mtime_ns
        except FileNotFoundError:
            continue
    return times


def kill_job(process):
    """Nobody has time to tidy up."""
    job = [process.pid, *processes.ranks_of(process.pid), *processes.children_of(process.pid)]
    for pid in job:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    message = process.communicate(timeout=60)[1]
    for pid in job:
        expect(processes.wait_gone(pid), f"{pid} outlives its death")
    return message


def until(process, true, what):
    """Waits for that while the process lives."""
    end = time.monotonic() + 120
    while process.poll() is None and not true():
        if time.monotonic() > end:
            expect(False, f"{what}: not within 120 s")
            break
        time.sleep(0.005)
    return process.poll() is None


def killed_at_random(folder, whole):
    """However often and whenever a run dies, what was drawn up to its last checkpoint is there, and the picture ends as
    that of an unbroken run."""
    chance = random.Random(14)
    deaths = 0
    for name, ranks in (("k.exr", "1"), ("l.exr", "2")):
        state = f"{name}.checkpoint"
        for attempt in range(40):
            before = generations(folder, state)
            resume = ["--resume"] if before else []
            process = start(folder, "-o", name, "--ranks", ranks, *resume)
            alive = attempt < 3 and until(process, lambda: generations(folder, state) != before, f"{name}: a checkpoint")
            if alive:
                time.sleep(chance.uniform(0.0, 0.7))
            if alive and process.poll() is None:
                kill_job(process)
                deaths += 1
                expect(bool(generations(folder, state)), f"{name}: killed, and no checkpoint is there")
                continue
            message = process.communicate(timeout=300)[1]
            expect(process.returncode == 0, f"{name}: left with {process.returncode}: {message[-800:]}")
            break
        same = (folder / name).exists() and (folder / name).read_bytes() == whole
        expect(same, f"{name}: other bits than a run without a break")
        left = sorted(path.name for path in folder.glob(f"{state}*"))
        expect(not left, f"{name}: a finished run leaves {left}")
    expect(deaths >= 4, f"no more than {deaths} runs were killed")


def two_generations(folder, name, *arguments):
    """Kills a run once it has written two checkpoints."""
    process = start(folder, "-o", name, *arguments)
    alive = until(process, lambda: len(generations(folder, f"{name}.checkpoint")) == 2, "two checkpoints")
    kill_job(process)
    expect(alive, f"{name}: ended before it had two checkpoints")


def lost_newest(folder, whole):
    state = folder / "m.exr.checkpoint"
    previous = folder / "m.exr.checkpoint.previous"
    two_generations(folder, "m.exr")
    newest, older = state.read_bytes(), previous.read_bytes()
    result = run(folder, "-o", "m.exr", "--spp", str(SAMPLES))
    expect(result.returncode == 4 and "--resume goes on with it, --force begins anew" in result.stderr,
           f"samples in the way: left with {result.returncode}: {result.stderr}")
    flipped = bytearray(newest)
    flipped[len(newest) // 3] ^= 1
    for case, damaged, said in (("flipped", bytes(flipped), "damaged"), ("missing", None, "cannot read")):
        previous.write_bytes(older)
        state.unlink(missing_ok=True)
        if damaged is not None:
            state.write_bytes(damaged)
        elif run(folder, "-o", "m.exr", "--spp", str(SAMPLES)).returncode != 4:
            expect(False, "an unfinished run's previous checkpoint is passed over")
        for auto in ([], ["--primary", "auto"]):
            if case != "missing" and auto:
                continue
            result = run(folder, "-o", "m.exr", "--spp", str(SAMPLES), "--resume", "--force", *auto)
            told = [line for line in result.stderr.splitlines() if line.startswith("hpr: warning")]
            expect(result.returncode == 0 and len(told) == 1 and said in told[0] and "going on from" in told[0],
                   f"{case}: left with {result.returncode} and {told}: {result.stderr[-800:]}")
            expect((folder / "m.exr").read_bytes() == whole, f"{case}: other bits than a run without a break")
            expect(not state.exists() and not previous.exists(), f"{case}: a finished run leaves a checkpoint")
            previous.write_bytes(older)
    (folder / "m.exr").unlink()
    state.write_bytes(newest)
    result = run(folder, "-o", "m.exr", "--spp", str(SAMPLES), "--resume", "--seed", "5")
    expect(result.returncode == 3 and "another run: its seed" in result.stderr, f"another seed: {result.returncode}: {result.stderr}")
    state.write_bytes(bytes(flipped))
    result = run(folder, "-o", "m.exr", "--spp", str(SAMPLES), "--resume", "--seed", "5")
    expect(result.returncode == 3 and "damaged; " in result.stderr and "another run: its seed" in result.stderr,
           f"damaged, and another seed before: {result.returncode}: {result.stderr}")
    previous.write_bytes(older[:-1])
    result = run(folder, "-o", "m.exr", "--spp", str(SAMPLES), "--resume", "--ranks", "2")
    expect(result.returncode == 3 and result.stderr.count("the checkpoint is damaged") == 2,
           f"both damaged: {result.returncode}: {result.stderr}")
    for path in (state, previous):
        path.unlink()


def full_disk(folder, whole):
    """A limit of file sizes that comes down on a running process stands for a disk that is full."""
    state = folder / "n.exr.checkpoint"
    process = start(folder, "-o", "n.exr")
    until(process, state.exists, "a checkpoint")
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (200_000, 200_000))  # more than the picture has
    lines = []
    for line in process.stderr:
        lines.append(line)
        if "going on without a checkpoint" in line:
            break
    expect(state.exists() or (folder / "n.exr.checkpoint.previous").exists(), "full disk: the checkpoint before is gone")
    kept = generations(folder, "n.exr.checkpoint")
    message = process.communicate(timeout=300)[1]
    expect(process.returncode == 0, f"full disk: left with {process.returncode}: {message[-800:]}")
    expect(bool(lines) and "going on without" in lines[-1] and bool(kept), "full disk: nothing is said of it")
    expect((folder / "n.exr").exists() and (folder / "n.exr").read_bytes() == whole, "full disk: other bits")


def how_often(folder):
    for wrong in ("often", "-1s", "5 parsecs"):
        result = run(folder, "-o", "o.exr", "--spp", "2", "--checkpoint-every", wrong)
        expect(result.returncode == 2 and "--checkpoint-every" in result.stderr, f"every {wrong}: {result.returncode}: {result.stderr}")
    for never in ("0", "never"):
        result = run(folder, "-o", "o.exr", "--spp", "12", "--checkpoint-every", never, "-v")
        expect(result.returncode == 0 and "samples are in" not in result.stderr, f"every {never}: {result.returncode}: {result.stderr[-800:]}")
        (folder / "o.exr").unlink(missing_ok=True)


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-checkpoint-") as scratch:
        folder = pathlib.Path(scratch)
        result = run(folder, "-o", "whole.exr", "--spp", str(SAMPLES))
        if result.returncode != 0:
            sys.exit(f"an unbroken run left with {result.returncode}: {result.stderr}")
        whole = (folder / "whole.exr").read_bytes()
        sort_last = ["--ranks", "3", "--distribute", "sort-last", "--strategy", "binary-swap"]
        stop_and_resume(folder, whole, "one rank, then three", itself, [], sort_last)
        stop_and_resume(folder, whole, "three ranks, then two", itself, sort_last, ["--ranks", "2"])
        stop_and_resume(folder, whole, "a signal to one rank of two", last_rank_of, ["--ranks", "2"], [])
        result = run(folder, "-o", "adaptive.exr", "--spp", str(SAMPLES), "--adaptive")
        expect(result.returncode == 0, f"--adaptive left with {result.returncode}: {result.stderr}")
        adaptive = (folder / "adaptive.exr").read_bytes()
        expect(adaptive != whole, "--adaptive makes no difference")
        for at in (12, 40):  # where all pixels get the same samples, and where they do not
            stop_and_resume(folder, adaptive, f"adaptive, at {at}, one rank, then three", itself, ["--adaptive"],
                            ["--adaptive", *sort_last], at)
        stop_and_resume(folder, adaptive, "adaptive, three ranks, then one", itself, ["--adaptive", *sort_last], ["--adaptive"], 40)
        result = run(folder, "-o", "denoised.exr", "--spp", str(SAMPLES), "--denoise")
        denoised = (folder / "denoised.exr").read_bytes()
        expect(denoised != whole, "--denoise makes no difference")
        stop_and_resume(folder, denoised, "denoised, at 5, one rank, then three", itself, ["--denoise"], ["--denoise", *sort_last], 5)
        state = write_and_go_on(folder, whole)
        if state.exists():
            refusals(folder, state)
        as_soon_as_mpi_starts(folder)
        enough_samples(folder)
        by_what_was_chosen_before(folder)
        nowhere_to_write(folder, whole)
        killed_at_random(folder, whole)
        lost_newest(folder, whole)
        full_disk(folder, whole)
        how_often(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
