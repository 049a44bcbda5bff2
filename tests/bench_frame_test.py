#!/usr/bin/env python3
"""`hpr bench frame`: every step of a frame is there, and the frame's floor is the sum of theirs.

usage: bench_frame_test.py HPR

Times are no test. Prints what was wrong and leaves with 1.
"""

import json
import pathlib
import sys
import tempfile

from program import expect, failures, run

spread = []
SMALL = ["gen:gallery", "--size", "96x64", "--quality", "draft", "--reps", "2"]


def rows_of(folder, *words):
    result = run(folder, "bench", "frame", *words, "--json")
    expect(result.returncode == 0, f"{words}: left with {result.returncode}: {result.stderr}")
    found = json.loads(result.stdout)
    expect(found["schema"] == "hpr.bench/1", found["schema"])
    for row in found["rows"]:
        expect(row["ours"] > 0 and row["unit"] == "ms", f"times: {row}")
        expect((row["floor"] is None) == (row["ratio"] is None), f"no floor, no ratio: {row}")
        if row["floor"]:
            expect(abs(row["ratio"] - row["floor"] / row["ours"]) < 1e-9 * row["ratio"], f"ratio: {row}")
    # Then come how its work spreads over threads.
    frame = next(i for i, row in enumerate(found["rows"]) if row["name"].startswith("the frame"))
    spread.append(found["rows"][frame + 1:])
    return found["rows"][:frame + 1]


def threads(folder):
    for count in (1, 2, 7):
        rows_of(folder, *SMALL, "--threads", str(count))
        rows = spread[-1]
        if count == 1:
            expect([row["name"] for row in rows] == ["processor time"], f"of one thread: {rows}")
            continue
        expect([row["name"] for row in rows] == ["processor time", "of one thread alone",
               f"{count} threads, loops shared evenly", f"{count} threads, loops as they are"], f"{rows}")
        everything, alone, even, scheduled = (row["ours"] for row in rows)
        expect(alone < everything and alone < even <= scheduled * 1.001 and scheduled < everything * 1.001, f"{rows}")
        expect(abs(rows[3]["floor"] - everything / count) < 1e-9 * everything, f"an even share: {rows}")


def steps(folder):
    rows = rows_of(folder, *SMALL, "--passes", "shadow,reflection")
    names = [row["name"].split(":")[0].split(" of")[0] for row in rows]
    expect(names == ["keys", "surface", "direct", "shadow", "reflection", "to the screen",
                     "the frame, 96x64, 1 sample"], f"steps: {names}")
    floors = sum(row["floor"] or 0 for row in rows[:-1])
    expect(abs(rows[-1]["floor"] - floors) < 1e-9 * floors, f"the frame's floor is not the sum: {rows}")
    expect(rows[-1]["ours"] > max(row["ours"] for row in rows[:-1]), f"a step is longer than the frame: {rows}")


def keys_alone(folder):
    for primary, name in (("raster", "keys of"), ("rays", "by rays")):
        rows = rows_of(folder, *SMALL, "--passes", "none", "--primary", primary)
        expect(name in rows[0]["name"] and rows[0]["floor"] > 0, f"{primary}: {rows[0]}")
        expect(not any("rays" in row["name"] for row in rows[1:]), f"no pass traces: {rows}")
    whole, quarter = (rows_of(folder, *SMALL, "--passes", "none", "--primary", "rays", "--resolution-scale", scale)
                      for scale in ("1", "0.25"))
    expect(quarter[0]["floor"] < 0.5 * whole[0]["floor"], f"a floor of more rays than there are: {quarter[0]}")
    two = rows_of(folder, *SMALL, "--passes", "none", "--spp", "2")
    expect(two[-1]["name"].endswith("2 samples"), two[-1]["name"])


def refused(folder):
    for words, code, hint in ((["--size", "0x3"], 2, "--size"), (["--passes", "shadwo"], 2, "shadow"),
                              (["--limit-image", "8x8"], 6, "--limit-image"), (["--ranks", "2"], 2, "bench scale"),
                              (["--spp", "until:1s"], 2, "--spp 16")):
        result = run(folder, "bench", "frame", *SMALL, *words)
        expect(result.returncode == code and "hint:" in result.stderr and hint in result.stderr,
               f"{words}: left with {result.returncode}: {result.stderr}")
    shown = run(folder, "bench", "frame", *SMALL, "--passes", "none")
    expect("ratio" in shown.stdout and " -" in shown.stdout and "the frame" in shown.stdout, shown.stdout)


def main():
    for case in (steps, threads, keys_alone, refused):
        with tempfile.TemporaryDirectory(prefix="hpr-frame-") as scratch:
            case(pathlib.Path(scratch))
    print(f"{len(failures)} failed" if failures else "every step has its row")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
