#!/usr/bin/env python3
"""What `hpr tradeoff` says of a scene is true: errors against hpr diff's, the front, budgets, going on after a stop.

usage: tradeoff_test.py HPR SOURCE

Prints what is wrong and leaves with 1.
"""

import csv
import json
import math
import os
import pathlib
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import xml.dom.minidom

from program import HPR, expect, failures

SOURCE = pathlib.Path(sys.argv[2])
SIZE = "96x64"


def hpr(folder, *arguments, code=0):
    result = subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False,
                            env={**os.environ, "HPR_CACHE": str(folder / "cache")})
    expect(result.returncode == code,
          f"hpr {' '.join(arguments)} left with {result.returncode}, not {code}: {result.stderr[-1000:]}")
    return result


def sweep(folder, *arguments):
    return json.loads(hpr(folder, "tradeoff", "gen:cornell", "--size", SIZE, "--reference-spp", "512", "--frames", "1", "--json",
                          *arguments).stdout)


def knobs(folder):
    text = hpr(folder, "help", "knobs").stdout
    help_text = hpr(folder, "wall", "run", "--help").stdout  # which has those of render too
    names = [line for line in text.splitlines() if line.startswith("--")]
    expect(len(names) > 10, f"no more than {len(names)} knobs")
    for name in names:
        expect(name in help_text, f"wall run has no option {name}")
    render_text = hpr(folder, "render", "--help").stdout
    expect([name for name in names if name not in render_text] == ["--codec", "--codec-quality", "--codec-error"],
          "render lacks other knobs than those of pictures on their way")


def errors_are_those_of_diff(folder):
    """A truth from a file; the point's errors must be what hpr diff finds between the same pictures."""
    hpr(folder, "render", "gen:cornell", "--size", SIZE, "--reference", "--spp", "64", "-o", "truth.exr")
    report = sweep(folder, "--vary", "spp=4", "--vary", "quality=draft,good", "--reference", "truth.exr")
    expect(report["schema"] == "hpr.tradeoff/1" and report["size"] == SIZE, "the report's head is wrong")
    expect(report["knobs"] == ["spp", "quality"], f"knobs: {report['knobs']}")
    expect(report["best_under_budget"] is None, "a best point without a budget")
    for point in report["points"]:
        quality = point["knobs"]["quality"]
        expect(point["knobs"]["spp"] == 4, "a number is no number in JSON")
        hpr(folder, "render", "gen:cornell", "--size", SIZE, "--spp", "4", "--quality", quality, "-o", "point.exr", "--force")
        diff = json.loads(hpr(folder, "diff", "truth.exr", "point.exr", "--json", "--metric", "rmse,relmse,ssim,flip,mean,max", code=1).stdout)
        error = point["error"]
        for ours, theirs in (("rmse", diff["rmse"]), ("relmse", diff["relmse"]), ("relmse_untrimmed", diff["relmse_untrimmed"]),
                             ("ssim", diff["ssim"]), ("flip", diff["flip"]), ("mean", diff["mean"])):
            expect(math.isclose(error[ours], theirs, rel_tol=1e-12), f"{quality}: {ours} is {error[ours]}, hpr diff says {theirs}")
        expect((error["worst"]["x"], error["worst"]["y"]) == (diff["worst"]["x"], diff["worst"]["y"]), "another worst pixel")


def front_and_budgets(folder):
    report = sweep(folder, "--vary", "reference=true", "--vary", "spp=1,4,16,64", "--budget", "relmse=0.02", "--html", "report.html",
                   "--csv", "report.csv", "--reference", "path")
    points = report["points"]
    for point in points:
        beaten = any(other["ms"]["median"] <= point["ms"]["median"] and other["error"]["relmse"] <= point["error"]["relmse"]
                     and other is not point for other in points)
        expect(point["pareto"] == (not beaten), f"the front is wrong at {point['knobs']}")
    slope = next(s for s in report["slopes"] if s["knob"] == "spp" and s["metric"] == "relmse")
    expect(-1.5 < slope["slope"] < -0.7, f"noise falls with power {slope['slope']} of the samples")
    best = report["best_under_budget"]
    within = [point for point in points if point["error"]["relmse"] <= 0.02]
    expect(best is not None and best["ms"] == min(within, key=lambda point: point["ms"]["median"])["ms"], "not the fastest within the budget")
    expect("--spp=" in best["command"] and best["command"].startswith("hpr render gen:cornell"), f"command: {best['command']}")
    xml.dom.minidom.parse(str(folder / "report.html"))
    with open(folder / "report.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    expect([float(row["relmse"]) for row in rows] == [point["error"]["relmse"] for point in points], "the CSV's errors differ")
    again = sweep(folder, "--vary", "reference=true", "--vary", "spp=1,4,16,64", "--reference", "path")
    expect(again["reference"]["cached"], "the truth is rendered twice")
    expect([p["error"] for p in again["points"]] == [p["error"] for p in points], "errors are not the same twice")
    nothing = sweep(folder, "--vary", "spp=1", "--reference", "path", "--budget", "1us")
    expect(nothing["best_under_budget"] is None, "something is drawn within a microsecond")


def ranks_agree(folder):
    alone = sweep(folder, "--vary", "spp=1,2", "--reference", "path")
    three = sweep(folder, "--vary", "spp=1,2", "--reference", "path", "--ranks", "3")
    expect(three["reference"]["cached"], "ranks do not share a truth")
    expect([p["error"] for p in alone["points"]] == [p["error"] for p in three["points"]], "other errors on three ranks")


def going_on(folder):
    arguments = ["tradeoff", "gen:cornell", "--size", SIZE, "--reference-spp", "16", "--vary", "spp=" + ",".join(map(str, range(60, 90))),
                 "--json", "--frames", "1", "--progress", "line"]
    process = subprocess.Popen([HPR, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "HPR_CACHE": str(folder / "cache")})
    states = []
    end = time.monotonic() + 120
    while not states and time.monotonic() < end and process.poll() is None:
        time.sleep(0.05)
        states = list((folder / "cache").glob("tradeoff-*.json"))
    process.send_signal(signal.SIGUSR1)
    process.communicate(timeout=120)
    expect(process.returncode == 75, f"USR1 made it leave with {process.returncode}")
    kept = json.loads(states[0].read_text())["points"]
    expect(0 < len(kept) < 30, f"{len(kept)} points are kept")
    # Other sweeps meanwhile take nothing away: of another knob, or of other values.
    hpr(folder, "tradeoff", "gen:cornell", "--size", SIZE, "--reference-spp", "16", "--frames", "1", "--vary", "max-depth=1")
    hpr(folder, "tradeoff", "gen:cornell", "--size", SIZE, "--reference-spp", "16", "--frames", "1", "--vary", "spp=3")
    report = json.loads(hpr(folder, *arguments, "--resume").stdout)
    expect(len(report["points"]) == 30, "points are missing")
    expect([p["ms"]["median"] for p in report["points"][:len(kept)]] == [p["all_ms"][0] for p in kept], "kept points were measured again")
    expect(not states[0].exists(), "a finished sweep leaves its points behind")


def photons_cost_in_every_point(folder):
    report = sweep(folder, "--passes", "shadow,photon", "--vary", "spp=1,2", "--vary", "photons=20000", "--reference", "path")
    one, two = (point["rays"]["photon"] for point in report["points"])
    expect(one > 10000 and abs(two / one - 2.0) < 0.1, f"one sample sends {one} photons, two {two}")


def commands_can_be_run(folder):
    """Whatever stands where on the line; words that a shell would take apart are quoted."""
    hpr(folder, "scene", "make", "cornell", "-o", "my scene.glb")
    report = json.loads(hpr(folder, "tradeoff", "--json", "--spp", "4", "my scene.glb", "--size", "32x32", "--passes", "shadow", "--vary", "spp=2,3",
                            "--vary", "no-terminator-fix=true", "--reference-spp", "16", "--frames", "1", "--no-terminator-fix",
                            "--budget", "3600s").stdout)
    words = shlex.split(report["best_under_budget"]["command"])
    expect(words[:3] == ["hpr", "render", "my scene.glb"] and words.count("my scene.glb") == 1, f"the command is {words}")
    expect("--passes=shadow" in words and "--spp" not in words, f"the command is {words}")
    hpr(folder, *words[1:])
    # Globals before the command, lists of several words, and the negation of a flag that is varied.
    report = json.loads(hpr(folder, "--seed", "3", "tradeoff", "--metric", "relmse", "flip", "--no-indirect", "--vary", "indirect=true",
                            "--json", "--size", "32x32", "--reference-spp", "16", "--frames", "1", "--budget", "3600s", "--eye=0,0,3.4",
                            "--at=0,0,0", "--", "gen:cornell").stdout)
    words = shlex.split(report["best_under_budget"]["command"])
    expect(words[:3] == ["hpr", "render", "gen:cornell"] and {"--seed=3", "--eye=0,0,3.4", "--indirect=true"} <= set(words)
          and not {"--", "flip", "tradeoff", "--no-indirect"} & set(words), f"the command is {words}")
    hpr(folder, *words[1:], "--force", "--stats", "best.json")
    drawn = json.loads((folder / "best.json").read_text())["rays"]
    expect(drawn == {**report["points"][0]["rays"]}, f"the command draws {drawn}, the sweep {report['points'][0]['rays']}")
    hpr(folder, "render", "gen:cornell", "--size", "32x32", "-o", "last.png", "--no-indirect", "--indirect", "--stats", "last.json")
    expect(json.loads((folder / "last.json").read_text())["rays"]["photon"] > 0, "of two flags the last one does not count")


def nothing_is_lost_with_the_output(folder):
    arguments = ["tradeoff", "gen:cornell", "--size", "32x32", "--reference-spp", "16", "--vary", "spp=7,8", "--frames", "1", "--metric", "relmse"]
    with open("/dev/full", "w", encoding="utf-8") as full:
        result = subprocess.run([HPR, *arguments], cwd=folder, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300, check=False,
                                env={**os.environ, "HPR_CACHE": str(folder / "cache")})
    expect(result.returncode == 4, f"a full disk: left with {result.returncode}")
    kept = list((folder / "cache").glob("tradeoff-*.json"))
    expect(len(kept) == 1, f"a full disk: {len(kept)} sweeps are kept")
    said = hpr(folder, *arguments, "--resume", "--progress", "line").stderr
    expect("anew" not in said, "what is kept is measured again")
    expect("anew" in hpr(folder, *arguments, "--resume").stderr, "begins anew without a word")


def a_truth_may_have_layers(folder):
    hpr(folder, "render", "gen:tetra", "-o", "layers.exr", "--aov", "depth", "--size", "32x32", "--spp", "2")
    hpr(folder, "tradeoff", "gen:tetra", "--size", "32x32", "--vary", "spp=1", "--reference", "layers.exr", "--frames", "1")


def refusals(folder):
    hpr(folder, "tradeoff", "gen:cornell", code=2)
    for wrong in ("ssp=1", "spp", "spp=0", "spp=1,1", "photons=many", "passes=shaddow"):
        hpr(folder, "tradeoff", "gen:cornell", "--vary", wrong, code=2)
    hpr(folder, "tradeoff", "gen:cornell", "--vary", "spp=1", "--budget", "flap=1", code=2)
    hpr(folder, "tradeoff", "gen:cornell", "--vary", "spp=1", "--metric", "flap", code=2)
    hpr(folder, "tradeoff", "gen:cornell", "--vary", "spp=1", "--reference", "nothing.exr", code=4)
    hpr(folder, "tradeoff", "gen:cornell", "--vary", "spp=1", "--reference", "truth.exr", "--size", "32x32", code=3)


with tempfile.TemporaryDirectory() as scratch:
    for part in (knobs, errors_are_those_of_diff, front_and_budgets, ranks_agree, going_on, photons_cost_in_every_point,
                 commands_can_be_run, nothing_is_lost_with_the_output, a_truth_may_have_layers, refusals):
        part(pathlib.Path(scratch))
sys.exit(1 if failures else 0)
