#!/usr/bin/env python3
"""Every row of docs/reliability.md names tests, and every name is a test that has label fault.

usage: fault_table_test.py CTEST BUILD ROOT

A name stands for the test of that name and those whose names go on after a dot.
"""

import json
import pathlib
import re
import subprocess
import sys


def main():
    ctest, build, root = sys.argv[1:]
    listed = subprocess.run([ctest, "--test-dir", build, "--show-only=json-v1", "-L", "fault"], capture_output=True, text=True,
                            timeout=100, check=True)
    labelled = [test["name"] for test in json.loads(listed.stdout)["tests"]]
    wrong, used = [], set()
    lines = (pathlib.Path(root) / "docs/reliability.md").read_text(encoding="utf-8").splitlines()
    for row in [line for line in lines if line.startswith("|") and not line.startswith(("|---", "| What fails"))]:
        names = re.findall(r"[A-Za-z0-9_.]+", row.rstrip("| ").rpartition("|")[2])
        if not names:
            wrong.append(f"no test: {row}")
        for name in names:
            meant = {test for test in labelled if test == name or test.startswith(name + ".")}
            used |= meant
            if not meant:
                wrong.append(f"no test '{name}' has label fault: {row}")
    wrong += [f"no row names {test}, which has label fault" for test in labelled if test not in used]
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
