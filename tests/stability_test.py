#!/usr/bin/env python3
"""`hpr stability`: every number has a limit and a verdict that follows from it, the page is well-formed, and what is
promised holds. With --full all cases are measured.

usage: stability_test.py HPR [--full]
"""

import json
import math
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree

HPR = str(pathlib.Path(sys.argv[1]).resolve())
FULL = "--full" in sys.argv[2:]
SLOW = {"accumulator", "coplanar", "frames", "scale", "watertight"}  # some seconds each
# Numbers with a parameter that goes on beyond what is promised.
NAMES_ITS_END = {"offset/exact-places", "offset/any-places", "offset/light", "offset/baked-vertices",
                 "scale/powers-of-two-placed", "scale/powers-of-two-vertices", "scale/light", "giant/triangle",
                 "photons/faint", "mirrors/decay", "lights/horizon", "acne/thin-wall"}
SVG = "{http://www.w3.org/2000/svg}"
LARGEST = sys.float_info.max
failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)
        print(f"failed: {message}")


def run(folder, *arguments, timeout=60, environment=None):
    return subprocess.run([HPR, "stability", *arguments], cwd=folder, capture_output=True, text=True, timeout=timeout,
                          check=False, env={**os.environ, **(environment or {})})


def check_json(text, code):
    document = json.loads(text)
    expect(document["schema"] == "hpr.stability/1", document["schema"])
    cases = document["cases"]
    expect(cases, "no case")
    for case in cases:
        name = case["name"]
        for key in ("name", "parameter", "unit", "why"):
            expect(isinstance(case[key], str) and case[key], f"{name}: {key} is {case[key]!r}")
        for key in ("limit", "measured"):
            value = case[key]
            expect(isinstance(value, (int, float)) and math.isfinite(value) and abs(value) < LARGEST,
                   f"{name}: {key} is {value!r}")
        at_most = case["bound"] == "at-most"
        holds = case["measured"] <= case["limit"] if at_most else case["measured"] >= case["limit"]
        expect(case["verdict"] == ("holds" if holds else "breaks"), f"{name}: {case}")
        expect(case["verdict"] == "holds", f"{name} breaks: {case['measured']} against {case['limit']} {case['unit']}")
        breaks_at = case["breaks_at"]
        expect(breaks_at is None or isinstance(breaks_at, (int, float)), f"{name}: breaks at {breaks_at!r}")
        expect(breaks_at is not None or name not in NAMES_ITS_END, f"{name}: names no value at which it breaks")
    expect(len({case["name"] for case in cases}) == len(cases), "a name stands twice")
    broken = any(case["verdict"] == "breaks" for case in cases)
    expect(code == (1 if broken else 0), f"exit code {code}")
    return cases


def check_page(text, cases):
    root = ElementTree.fromstring(text.split("\n", 1)[1])  # without the DOCTYPE
    rows = root.findall(".//tbody/tr")
    expect(len(rows) == len(cases), f"{len(rows)} rows for {len(cases)} numbers")
    expect([row.find("th").text for row in rows] == [case["name"] for case in cases], "other names in the page")
    expect(root.findall(f".//{SVG}svg"), "no plot")
    expect(not root.findall(".//script"), "a script")


def check_options(folder):
    """Errors, and the list: returns the names of the quick cases."""
    unknown = run(folder, "--case", "depth-ordr")
    expect(unknown.returncode == 2, f"unknown case: exit code {unknown.returncode}")
    expect("depth-order" in unknown.stderr and not unknown.stdout, "the nearest name is not told")
    (folder / "there.html").write_text("mine")
    there = run(folder, "--case", "nodes", "--html", "there.html")
    expect(there.returncode == 4, f"file that exists: exit code {there.returncode}")
    expect((folder / "there.html").read_text() == "mine", "a file was overwritten")
    listed = run(folder, "--list")
    expect(listed.returncode == 0, f"--list: exit code {listed.returncode}")
    names = {line.split()[0] for line in listed.stdout.splitlines()}
    expect(SLOW < names, f"--list lacks {SLOW - names}")
    return names - SLOW


def check_temporary_files(folder):
    """Where there is no place for them the cases that need one break, and say why; a run that is ended leaves none."""
    nowhere = run(folder, "--case", "nodes,not-finite", "--json", environment={"TMPDIR": "/nonexistent/folder"})
    expect(nowhere.returncode == 1, f"no TMPDIR: exit code {nowhere.returncode}: {nowhere.stderr}")
    ended = {case["name"]: case["parameter"] for case in json.loads(nowhere.stdout or '{"cases": []}')["cases"]}
    expect(sorted(ended) == ["nodes/ended", "not-finite/ended"], f"no TMPDIR: {ended}")
    expect(all("TMPDIR" in why and "/nonexistent/folder" in why for why in ended.values()), f"no TMPDIR: {ended}")
    scratch = folder / "scratch"
    scratch.mkdir()
    for number in (signal.SIGINT, signal.SIGTERM):
        process = subprocess.Popen([HPR, "stability", "--case", "not-finite"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL, env={**os.environ, "TMPDIR": str(scratch)})
        until = time.monotonic() + 0.5
        while time.monotonic() < until and not any(scratch.iterdir()):
            time.sleep(0.001)
        process.send_signal(number)
        process.wait(timeout=30)
        left = [path.name for path in scratch.iterdir()]
        expect(not left, f"signal {number} leaves {left}")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        quick = check_options(folder)
        check_temporary_files(folder)
        chosen = [] if FULL else ["--case", ",".join(sorted(quick))]
        done = run(folder, *chosen, "--json", "--html", "page.html", timeout=900 if FULL else 60)
        if done.returncode == 5:
            print(f"no graphics here: {done.stderr}")
            return 77
        expect(done.returncode in (0, 1), f"exit code {done.returncode}: {done.stderr}")
        expect(done.stdout, f"no findings: {done.stderr}")
        if done.stdout:
            cases = check_json(done.stdout, done.returncode)
            check_page((folder / "page.html").read_text(), cases)
    return 1 if failures else 0


sys.exit(main())
