#!/usr/bin/env python3
"""`hpr bench scale`: jobs of every size make the same frames, and all of them are in the reports.

usage: bench_scale_test.py HPR

Times are no test. Prints what was wrong and leaves with 1.
"""

import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

from program import HPR, expect, failures, run

PLAIN = ["gen:cornell", "--size", "128x128"]
SMALL = [*PLAIN, "--spp", "1"]


def sizes(folder):
    result = run(folder, "bench", "scale", *SMALL, "--ranks", "1,3", "--threads", "1,2", "--tiles", "1x1,2x1", "--reps",
                 "4", "--json", "--csv", "r.csv", "--html", "r.html")
    expect(result.returncode == 0, f"left with {result.returncode}: {result.stderr}")
    found = json.loads(result.stdout)
    expect(found["schema"] == "hpr.bench-scale/1" and found["pictures_agree"], found["schema"])
    cases = {(row["tiles"], row["ranks"], row["threads"]) for row in found["runs"]}
    wanted = {(tiles, ranks, threads) for tiles in ("1x1", "2x1") for ranks in (1, 3) for threads in (1, 2)}
    expect(cases == wanted and len(found["runs"]) == len(wanted), f"runs: {cases}")
    for row in found["runs"]:
        expect(row["frames"] == 4 and 0 < row["ms"]["min"] <= row["ms"]["median"] <= row["ms"]["max"], f"times: {row}")
        expect(len(row["rank_ms"]) == row["ranks"] and row["hosts"] == 1 and row["gpus"] >= 0, f"ranks: {row}")
        expect((row["bytes_sent"] > 0) == (row["ranks"] > 1), f"bytes: {row}")
    with (folder / "r.csv").open(newline="") as file:
        expect(len(list(csv.DictReader(file))) == 4 * len(wanted), "one line per frame")
    xml.etree.ElementTree.parse(folder / "r.html")

    again = run(folder, "--ranks", "2", "bench", "scale", *SMALL, "--reps", "2", "--trace", "t.json", "--json")
    expect(again.returncode == 0, f"traced: {again.stderr}")
    expect([row["ranks"] for row in json.loads(again.stdout)["runs"]] == [2], "--ranks before the command")
    expect(len(json.loads((folder / "t.json").read_text())["traceEvents"]) > 10, "an empty trace")

    drawn = run(folder, "wall", "run", "1x1@128x128", "gen:cornell", "--spp", "1", "--exposure", "0", "-o", "wall")
    expect(drawn.returncode == 0, drawn.stderr)
    manifest = json.loads((folder / "wall" / "manifest.json").read_text())
    expect(manifest["frames"][0]["screens"][0]["xxh64"] == found["runs"][0]["frame_xxh64"], "another frame than a wall's")


def inside_a_job(folder):
    mpiexec = shutil.which("mpiexec")
    result = subprocess.run([mpiexec, "--allow-run-as-root", "--oversubscribe", "-n", "2", HPR, "--threads", "1", "bench",
                             "scale", *SMALL, "--reps", "1", "--json"], cwd=folder, capture_output=True, text=True, timeout=120,
                            check=False)
    expect(result.returncode == 0, result.stderr)
    rows = json.loads(result.stdout)["runs"]
    expect([(row["ranks"], row["threads"]) for row in rows] == [(2, 1)], f"the job's ranks: {rows}")


def simulated(folder):
    cluster = "hosts=4,ranks=8,latency=5us,bandwidth=1GB/s"
    result = run(folder, "bench", "scale", *SMALL, "--simulate", cluster, "--sides", "2", "--tiles", "1x1,2x1", "--json", "--csv",
                 "m.csv", "--html", "m.html")
    expect(result.returncode == 0, f"left with {result.returncode}: {result.stderr}")
    found = json.loads(result.stdout)
    expect(found["schema"] == "hpr.bench-scale-model/1" and found["simulated"]["latency_s"] == 5e-6, f"{found['schema']}")
    runs = {(row["tiles"], row["ranks"], row["distribution"]): row for row in found["runs"]}
    expect(len(runs) == len(found["runs"]) == 2 * 4 * 4, f"runs: {sorted(runs)}")
    for row in found["runs"]:
        phases = sum(row[f"ms_{phase}"] for phase in ("draw", "composite", "light", "prepare", "show"))
        expect(abs(phases - row["ms"]) < 1e-6 * row["ms"], f"phases: {row}")
        expect(row["hosts"] == min(4, (row["ranks"] + 1) // 2), f"hosts: {row}")
        expect(row["efficiency"] > 0.9 or row["limit"], f"limit: {row}")
    with (folder / "m.csv").open(newline="") as file:
        expect(len(list(csv.DictReader(file))) == len(runs), "one line per run")
    xml.etree.ElementTree.parse(folder / "m.html")
    expect("No frame was drawn on such a cluster" in (folder / "m.html").read_text(), "a page that looks measured")
    for words, hint in ((["--ranks", "2"], "ranks=N"), (["--data", "partitioned"], "without --simulate")):
        refusal = run(folder, "bench", "scale", *SMALL, "--simulate", cluster, *words)
        expect(refusal.returncode == 2 and hint in refusal.stderr, f"{words}: {refusal.returncode} {refusal.stderr}")
    alone = run(folder, "bench", "scale", *SMALL, "--sides", "2")
    expect(alone.returncode == 2 and "--simulate" in alone.stderr, f"--sides alone: {alone.stderr}")


def refused(folder):
    for words, code, hint in ((["--tiles", "70x70"], 6, "4096"), (["--spp", "until:1s"], 2, "--spp 16"),
                              (["--primary", "auto"], 2, "raster"), (["--ranks", "0"], 2, "--ranks 1,2"), (["--threads", "1,x"], 2, "--threads 1,2"),
                              (["--tiles", "2"], 2, "--tiles 3x2"), (["--limit-image", "64x64"], 6, "--limit-image"),
                              (["--quality", "god"], 2, "good"), (["--csv", "a", "--html", "a"], 2, "")):
        result = run(folder, "bench", "scale", *PLAIN, *words)
        expect(result.returncode == code, f"{words}: left with {result.returncode}: {result.stderr}")
        expect("hint:" in result.stderr and hint in result.stderr, f"{words}: {result.stderr}")
    missing = run(folder, "bench", "scale", "nothing.glb", "--ranks", "1,2")
    expect(missing.returncode == 4 and missing.stderr.count("error:") == 1, f"a missing scene: {missing.stderr}")


def main():
    for case in (sizes, inside_a_job, simulated, refused):
        with tempfile.TemporaryDirectory(prefix="hpr-scale-") as scratch:
            case(pathlib.Path(scratch))
    print(f"{len(failures)} failed" if failures else "frames scale alike")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
