#!/usr/bin/env python3
"""Runs what the README shows: every ```sh block, in order, line by line, in a copy of the sources.

usage: readme_test.py HPR ROOT [README]

The copy holds what git knows of (no build folder); its PATH starts with the built hpr. Lines marked
`# not run: REASON` are skipped, blocks are run by bash -e, and a block that fails ends the test with 1.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks_of(text):
    """(number of the first line, commands to run) of each block; skipped lines are gone."""
    found = []
    for match in BLOCK.finditer(text):
        lines = [line for line in match.group(1).splitlines() if "# not run:" not in line]
        found.append((text.count("\n", 0, match.start()) + 2, "\n".join(lines)))
    return found


def copy_of_sources(root, target):
    listed = subprocess.run(["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                            capture_output=True, check=False)
    if listed.returncode == 0:
        for name in filter(None, listed.stdout.decode().split("\0")):
            if (root / name).is_file():
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, target / name)
    else:  # an unpacked archive
        shutil.copytree(root, target, dirs_exist_ok=True, ignore=shutil.ignore_patterns("build", ".git", "out"))


def main():
    hpr = pathlib.Path(sys.argv[1]).resolve()
    root = pathlib.Path(sys.argv[2]).resolve()
    readme = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else root / "README.md"
    if not readme.is_file():
        print(f"there is no {readme}")
        return 1
    blocks = blocks_of(readme.read_text())
    if not blocks:
        print(f"{readme} has no sh blocks")
        return 1
    with tempfile.TemporaryDirectory(prefix="hpr-readme-") as scratch:
        copy_of_sources(root, pathlib.Path(scratch))
        environment = {**os.environ, "PATH": f"{hpr.parent}{os.pathsep}{os.environ['PATH']}"}
        for line, commands in blocks:
            if not commands.strip():
                continue
            result = subprocess.run(["bash", "-euo", "pipefail", "-c", commands], cwd=scratch, env=environment, text=True,
                                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
            print(f"{readme.name}:{line}: {'runs' if result.returncode == 0 else f'left with {result.returncode}'}")
            if result.returncode != 0:
                print(f"{commands}\n{result.stdout[-4000:]}")
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
