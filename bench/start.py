#!/usr/bin/env python3
"""What a start costs: the processor time of whole processes, user and system.

usage: start.py HPR [OTHER_HPR] [--runs N]

Runs the smallest commands of each program in turn, N times (20), so that a busy machine is busy for all. Prints the medians
in ms, and those of HPR by those of OTHER_HPR.
"""
import argparse
import os
import statistics
import subprocess
import tempfile

PICTURE = ["render", "gen:cornell", "--size", "32x32", "-o", "a.png", "--force"]
COMMANDS = [["--version"], PICTURE, [*PICTURE, "--primary", "rays"], [*PICTURE, "--primary", "raster"]]


def processor_ms(command, folder):
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{command} left with {os.waitstatus_to_exitcode(status)}")
    return 1e3 * (usage.ru_utime + usage.ru_stime)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr", nargs="+", type=os.path.abspath)
    parser.add_argument("--runs", type=int, default=20)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for command in COMMANDS:
            times = {program: [] for program in options.hpr}
            for _ in range(options.runs):
                for program, list_of_times in times.items():
                    list_of_times.append(processor_ms([program, *command], folder))
            medians = [statistics.median(each) for each in times.values()]
            ratio = f"  ratio {medians[0] / medians[1]:.2f}" if len(medians) > 1 else ""
            print(" ".join(command), " ".join(f"{median:.1f} ms" for median in medians), ratio)


if __name__ == "__main__":
    main()
