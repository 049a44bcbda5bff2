#!/usr/bin/env python3
"""Every source stands as clang-format writes it, and no file is longer than the limit of 700 lines.

usage: check_format.py ROOT

Leaves with 1 when a file does not, with 77 (skipped) where clang-format is not installed.
"""

import pathlib
import shutil
import subprocess
import sys

FOLDERS = ["core", "image", "scene", "cluster", "raster", "compositing", "rt", "walls", "engine", "app", "tools", "tests",
           "bench", "docs"]
LONGEST = 700


def main(root):
    files = [f for folder in FOLDERS for f in sorted((root / folder).rglob("*")) if f.suffix in {".h", ".cpp"}]
    long = [f for f in files if len(f.read_text().splitlines()) > LONGEST]
    for file in long:
        print(f"{file.relative_to(root)}: longer than {LONGEST} lines; split it")
    tool = shutil.which("clang-format")
    if tool is None:
        print("clang-format is not installed; only the lengths were checked")
        return 1 if long else 77
    verdict = subprocess.run([tool, "--dry-run", "-Werror", "--ferror-limit=3", *files], check=False)
    if verdict.returncode != 0:
        print("run: clang-format -i on the files above")
    return 1 if long or verdict.returncode != 0 else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
