#!/usr/bin/env python3
"""Models of every extension that HPR reads against values computed from the specifications.

usage: extension_models_test.py HPR [--models N] [--kind NAME]

Draws N (20) models of each kind (extension_models.py and extension_materials.py) and compares their pixels. Prints what
differs and leaves with 1.
"""

import argparse
import concurrent.futures
import os
import pathlib
import random
import sys
import tempfile

import exr
import extension_materials
import extension_models
from program import expect, failures, plain, run

KINDS = extension_models.KINDS | extension_materials.KINDS


def differences(folder, kind, number):
    """What one model shows that it should not, as lines."""
    model = KINDS[kind](random.Random(f"{kind} {number}"), number)
    name = f"{kind.replace(' ', '_')}_{number}"
    model.write(folder / f"{name}.gltf")
    options = plain(*model.arguments)
    result = run(folder, "render", f"{name}.gltf", "-o", f"{name}.exr", "--size", f"{model.size}x{model.size}", "--threads", "1",
                 "--force", *options)
    where = f"{kind} model {number}"
    if result.returncode != model.exit_code or model.message not in result.stderr:
        return [f"{where}: left with {result.returncode}, not {model.exit_code}: {result.stderr[-500:]}"]
    if model.exit_code != 0:
        return []
    if not model.expected:
        return [f"{where}: nothing is expected"]
    _, _, values = exr.read(folder / f"{name}.exr")
    lines = []
    for (column, row), color, relative, absolute in model.expected:
        found = [values[channel][row * model.size + column] for channel in "RGB"]
        if any(not abs(f - e) <= absolute + relative * abs(e) for f, e in zip(found, color)):
            quotients = [f / e if e else f for f, e in zip(found, color)]
            lines.append(f"{where}: pixel {column},{row} is {found}, not {color}: {quotients}")
    return lines


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--models", type=int, default=20)
    parser.add_argument("--kind", default="")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = pathlib.Path(name)
        for kind in KINDS:
            if options.kind not in kind:
                continue
            wrong = list(pool.map(lambda number, kind=kind: differences(folder, kind, number), range(options.models)))
            good = sum(not lines for lines in wrong)
            print(f"{kind}: {good} of {options.models} models")
            expect(good == options.models, "\n  ".join([kind, *(line for lines in wrong for line in lines[:3])]))
    return 1 if failures else 0


sys.exit(main())
