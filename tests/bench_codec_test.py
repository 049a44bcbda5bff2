#!/usr/bin/env python3
"""`hpr bench codec`: its rows are there, lossless codecs lose nothing, bounds hold, compressors compress.

usage: bench_codec_test.py HPR
"""

import json
import pathlib
import subprocess
import sys

HPR = str(pathlib.Path(sys.argv[1]).resolve())
CODECS = ["raw", "lz4", "zstd", "jpeg", "lz4 within 2", "zstd within 2", "jpeg within 2"]
failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)
        print(f"failed: {message}")


def run(*arguments):
    return subprocess.run([HPR, "bench", "codec", *arguments], capture_output=True, text=True, timeout=100, check=False)


def check_rows():
    done = run("gen:cornell", "--size", "200x130", "--frames", "2", "--json")
    expect(done.returncode == 0, f"leaves with {done.returncode}: {done.stderr}")
    document = json.loads(done.stdout)
    expect(document["schema"] == "hpr.bench/1", document["schema"])
    rows = {row["name"]: row for row in document["rows"]}
    for codec in CODECS:
        for what in ["encode", "decode", "smaller by", "largest error"]:
            expect(f"gen:cornell, {codec}: {what}" in rows, f"no row of {codec}: {what}")
        for what in ["encode", "decode"]:
            row = rows[f"gen:cornell, {codec}: {what}"]
            expect(row["unit"] == "MB/s" and row["ours"] > 0 and row["floor"] > 0, row)
            expect(abs(row["ratio"] - row["ours"] / row["floor"]) < 1e-6 * row["ratio"], row)
        error = rows[f"gen:cornell, {codec}: largest error"]["ours"]
        if codec == "jpeg":
            expect(error > 2, f"jpeg without a bound is within {error}: the picture is too easy for this test")
        else:
            expect(error <= (2 if "within" in codec else 0), f"{codec} errs by {error}")
        smaller = rows[f"gen:cornell, {codec}: smaller by"]["ours"]
        expect(smaller > 1.5 if codec != "raw" else 0.99 < smaller <= 1, f"{codec} makes it smaller by {smaller}")
    exact = rows["gen:cornell, zstd: smaller by"]["ours"]
    bound = rows["gen:cornell, zstd within 2: smaller by"]["ours"]
    expect(bound > 1.1 * exact, f"a bound of 2 takes zstd from {exact} to {bound}")
    for motion in ["turning", "standing"]:
        expect(rows[f"gen:cornell {motion}, zstd: deltas, smaller by"]["ours"] > 1.5, motion)


def check_errors():
    for arguments in [["--size", "0x3"], ["--frames", "0"], ["gen:nothing"]]:
        done = run(*arguments)
        expect(done.returncode == 2, f"{arguments} leaves with {done.returncode}")
        expect("hint" in done.stderr or "--help" in done.stderr, done.stderr)


check_rows()
check_errors()
sys.exit(1 if failures else 0)
