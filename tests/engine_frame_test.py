#!/usr/bin/env python3
"""A program of 30 lines that links the engine alone draws the picture of `hpr render`, bit by bit.

usage: engine_frame_test.py HPR RENDER_FRAME
"""

import pathlib
import subprocess
import sys
import tempfile

from program import expect, failures, plain, run


def main():
    program = pathlib.Path(sys.argv[2]).resolve()
    with tempfile.TemporaryDirectory(prefix="hpr-engine-") as folder:
        for scene in ("gen:tetra", "gen:gallery"):
            result = subprocess.run([program, scene, "own.exr"], cwd=folder, capture_output=True, text=True, timeout=100,
                                    check=False)
            if not expect(result.returncode == 0, f"{scene}: left with {result.returncode}: {result.stderr}"):
                continue
            run(folder, "render", scene, "--size", "320x240", *plain(), "-o", "whole.exr", "--force")
            difference = run(folder, "diff", "whole.exr", "own.exr")
            expect(difference.returncode == 0, f"{scene}: another picture: {difference.stdout}{difference.stderr}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
