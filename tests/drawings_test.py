#!/usr/bin/env python3
"""The drawings of docs/compositing.md are what the strategies do now.

usage: drawings_test.py DRAW_STRATEGIES ROOT
"""

import pathlib
import re
import subprocess
import sys
import tempfile


def main():
    tool, root = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    kept = root / "docs" / "images" / "compositing"
    with tempfile.TemporaryDirectory(prefix="hpr-drawings-") as folder:
        subprocess.run([tool, folder], check=True, timeout=60)
        made = {file.name: file.read_bytes() for file in pathlib.Path(folder).iterdir()}
    have = {file.name: file.read_bytes() for file in kept.iterdir()}
    wrong = sorted(name for name in made.keys() | have.keys() if made.get(name) != have.get(name))
    for name in wrong:
        print(f"{kept / name}: not what is drawn now")
    if wrong:
        print(f"run: {tool} {kept}")
    shown = set(re.findall(r"images/compositing/([^)]+)", (root / "docs" / "compositing.md").read_text()))
    for name in sorted(shown ^ have.keys()):
        print(f"{name}: {'no such file' if name in shown else 'docs/compositing.md does not show it'}")
    return 1 if wrong or shown != have.keys() or not made else 0


if __name__ == "__main__":
    sys.exit(main())
