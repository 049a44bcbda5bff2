#!/usr/bin/env python3
"""`hpr wall init`: what it writes is a wall without a finding, asks nothing, and drives the hosts it was told.

usage: wall_init_test.py HPR
"""

import json
import pathlib
import sys
import tempfile

from program import expect, failures, run


def check_walls(folder):
    walls = {
        "day one": (["--cols", "6", "--rows", "3", "--hosts", "wall0[1-9]", "--tiles-per-host", "2"], 18, 9),
        "several brackets": (["--cols", "4", "--rows", "2", "--hosts", "r[1-2]n[08-09],x"], 8, 5),
        "this machine": (["--cols", "2", "--rows", "1"], 2, 1),
        "measured": (["--cols", "3", "--rows", "2", "--hosts", "a[01-03]", "--tile-pixels", "3840x2160", "--tile-size-m",
                      "1.2096x0.6804", "--gap-m", "0.0018x0.0035"], 6, 3),
        "overlaps": (["--cols", "3", "--rows", "1", "--gap-m", "-0.02", "--tile-size-m", "0.64x0.36"], 3, 1),
    }
    for name, (options, screens, hosts) in walls.items():
        made = run(folder, "wall", "init", *options)
        expect(made.returncode == 0 and made.stderr == "", f"{name}: {made.returncode}, {made.stderr}")
        (folder / "wall.toml").write_text(made.stdout)
        checked = run(folder, "wall", "check", "wall.toml", "--json")
        said = json.loads(checked.stdout)
        expect(checked.returncode == 0 and said["ok"] and said["findings"] == [], f"{name}: {checked.stdout}")
        expect((said["screens"], said["hosts"]) == (screens, hosts), f"{name}: {said['screens']} on {said['hosts']}")
        remarks = sum(line.startswith("#") for line in made.stdout.splitlines())
        expect(remarks >= 6, f"{name}: only {remarks} lines of comments")


def check_file(folder):
    one = run(folder, "wall", "init", "--cols", "2", "--rows", "1", "--tile-pixels", "64x36", "-o", "new.toml")
    expect(one.returncode == 0 and one.stdout == "", f"-o: {one.returncode}, {one.stdout}")
    before = (folder / "new.toml").read_text()
    again = run(folder, "wall", "init", "--cols", "3", "--rows", "1", "-o", "new.toml")
    expect(again.returncode == 4 and (folder / "new.toml").read_text() == before, f"overwrites without --force: {again}")
    shown = run(folder, "wall", "run", "new.toml", "gen:cornell", "--passes", "none", "-o", "out")
    expect(shown.returncode == 0 and (folder / "out" / "wall.png").exists(), f"it does not run: {shown.stderr}")


def check_errors(folder):
    three_by_two = ["--cols", "3", "--rows", "2"]
    for options, words in (
            ([*three_by_two, "--hosts", "a[3-1]"], "runs backwards"),
            ([*three_by_two, "--hosts", "a[1-2"], "never closes"),
            ([*three_by_two, "--hosts", "a[1-2],a1"], "names 'a1' twice"),
            ([*three_by_two, "--hosts", "a[1-4]", "--tiles-per-host", "2"], "take 3 hosts, but 4 are named"),
            ([*three_by_two, "--hosts", "a[1-7]"], "7 hosts for 6 screens"),
            ([*three_by_two, "--tiles-per-host", "2"], "needs hosts"),
            ([*three_by_two, "--tile-pixels", "1920"], "no size of a screen"),
            ([*three_by_two, "--tile-size-m", "1.0"], "no two lengths"),
            ([*three_by_two, "--gap-m", "5mm"], "no two lengths"),
            (["--cols", "3"], "--rows"),
            (["--cols", "0", "--rows", "2"], "0 x 2 screens")):
        done = run(folder, "wall", "init", *options)
        expect(done.returncode == 2 and words in done.stderr and done.stdout == "",
               f"{options} leaves with {done.returncode}: {done.stdout[:60]}{done.stderr}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-wall-init-") as scratch:
        for check in (check_walls, check_file, check_errors):
            check(pathlib.Path(scratch))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
