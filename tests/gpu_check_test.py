#!/usr/bin/env python3
"""scripts/gpu-check, on a device of the CPU: every step has a result, and a wrong picture is found.

usage: gpu_check_test.py HPR SOURCE

Prints what was wrong and leaves with 1; with 77 where Vulkan has no device.
"""

import importlib.machinery
import importlib.util
import json
import pathlib
import subprocess
import sys
import tempfile

from program import HPR, expect, failures

SCRIPT = (pathlib.Path(sys.argv[2]) / "scripts" / "gpu-check").resolve()
KEYS = {"name", "kind", "value", "unit", "target", "status", "reason", "seconds"}


def gpu_check(folder, *arguments, program=HPR):
    result = subprocess.run([sys.executable, str(SCRIPT), "--hpr", str(program), "-o", "found.json", *arguments], cwd=folder,
                            capture_output=True, text=True, timeout=100, check=False)
    found = folder / "found.json"
    document = json.loads(found.read_text()) if found.exists() else None
    found.unlink(missing_ok=True)
    return result, document


def everything(folder):
    result, document = gpu_check(folder, "--software", "--steps", "comparisons,figures")
    if result.returncode == 77:
        return False
    if not expect(result.returncode == 0 and document is not None, f"left with {result.returncode}: {result.stderr[-1500:]}"):
        return True
    expect(document["schema"] == "hpr.gpu-check/1" and document["passed"], f"{document['schema']}")
    expect(document["device"] and document["driver"] and document["commit"] and document["machine"]["cores"] > 0, f"{document}")
    steps = document["steps"]
    expect(all(set(step) == KEYS and step["status"] == "passed" for step in steps), f"{steps}")
    expect({step["kind"] for step in steps} == {"comparisons", "figures"}, f"{steps}")
    figures = [step for step in steps if step["kind"] == "figures"]
    expect(len(figures) == 8 and all(step["value"] > 0 for step in figures), f"{figures}")
    return True


def wrong_pictures(folder):
    """A program whose device sees other surfaces in one scene, and lights another one by other numbers."""
    program = folder / "wrong"
    program.write_text(f'''#!/bin/sh
case "$*" in
"render gen:cornell "*vulkan*) exec {HPR} "$@" --eye 0,1,3 --at 0,1,0;;
"render gen:gallery "*vulkan*) exec {HPR} "$@" --seed 7;;
esac
exec {HPR} "$@"
''')
    program.chmod(0o755)
    result, document = gpu_check(folder, "--software", "--steps", "comparisons", program=program)
    failed = [step["name"] for step in document["steps"] if step["status"] == "failed"]
    expect(result.returncode == 1 and not document["passed"], f"wrong pictures: left with {result.returncode}")
    for wrong in ("gen:cornell: pixels with another surface", "gen:gallery: light against"):
        expect(any(name.startswith(wrong) for name in failed), f"{wrong}: found {failed}")
    expect(not any(name.startswith("gen:gallery: pixels") for name in failed), f"the same surfaces: {failed}")


def rules(folder):
    sys.dont_write_bytecode = True
    loader = importlib.machinery.SourceFileLoader("gpu_check", str(SCRIPT))
    script = importlib.util.module_from_spec(importlib.util.spec_from_loader("gpu_check", loader))
    loader.exec_module(script)
    check = script.Check(HPR, True, folder)
    for kind, strict, fatal in (("figures", False, False), ("figures", True, True), ("comparisons", False, True)):
        check.steps.clear()
        check.step(kind, "slow", lambda: 5.0, "ms", 4.0)
        check.step(kind, "quick", lambda: 3.0, "ms", 4.0)
        check.step(kind, "more", lambda: 5.0, "GB/s", 4.0, at_least=True)
        expect([step["status"] for step in check.steps] == ["failed", "passed", "passed"], f"{check.steps}")
        expect(script.is_fatal(check.steps[0], strict) == fatal, f"{kind}, strict {strict}")

    def breaks():
        raise script.Failed("nothing came")

    check.step("figures", "none", breaks)
    expect(script.is_fatal(check.steps[-1], False) and check.steps[-1]["reason"] == "nothing came", "a figure that could not be had")
    check.start -= script.MAX_SECONDS
    check.step("figures", "late", lambda: 1.0)
    expect(check.steps[-1]["status"] == "skipped", "a step after the time is over")
    result, _ = gpu_check(folder, "--steps", "speed")
    expect(result.returncode == 2 and "figures" in result.stderr, f"an unknown kind of steps: {result.returncode}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-gpu-check-") as scratch:
        folder = pathlib.Path(scratch)
        if not everything(folder):
            print("Vulkan has no device here that can do hpr's work")
            return 77
        wrong_pictures(folder)
        rules(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
