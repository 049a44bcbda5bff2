#!/usr/bin/env python3
"""How many files it takes to add one example of each kind of thing: docs/examples/add_KIND.patch.

usage: touch_counts_test.py [--build DIR CMAKE] ROOT

Every patch applies to the tree as it stands and touches at most as many files as TOUCHES allows for its kind; every
kind has a patch. With --build, a copy of the tree in DIR gets all patches, is built, and each patch's own check is run
in DIR/checks, which is empty then: what an earlier run left there is removed first. The head of a patch has the lines

    Check: hpr scene list | grep NAME
    Build: TARGET                         what the check needs beside hpr; may be left out

The check is a line of shell that succeeds when the example works; programs of the build are found by name. Leaves with
77 (skipped) where git is not installed.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

# The most files an example may touch, by kind.
TOUCHES = {
    "pass": 4,
    "setting": 3,
    "command": 3,
    "wall_key": 2,
    "strategy": 3,
    "codec": 3,
    "display": 3,
    "generator": 3,
    "importer": 3,
    "stability_case": 3,
}

EXAMPLES = "docs/examples"
failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)
        print(f"failed: {message}")


def run(*arguments, cwd=None):
    return subprocess.run([str(a) for a in arguments], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, errors="replace", check=False)


def head_lines(patch, key):
    """The values of the lines `KEY: value` before the first file of a patch."""
    head = patch.read_text().split("\ndiff --git ")[0]
    return re.findall(rf"^\W*{key}:\s*(.+?)\s*$", head, re.MULTILINE)


def touched(root, patch):
    """The files a patch touches."""
    result = run("git", "apply", "--numstat", patch, cwd=root)
    return [line.split("\t")[2] for line in result.stdout.splitlines() if line.count("\t") == 2]


def check_patch(root, patch, kind):
    limit = TOUCHES.get(kind)
    expect(limit is not None, f"{patch.name}: no kind of TOUCHES")
    expect(head_lines(patch, "Check"), f"{patch.name}: its head has no line `Check: COMMAND`")
    result = run("git", "apply", "--check", patch, cwd=root)
    expect(result.returncode == 0, f"{patch.name}: does not apply: {result.stdout.strip()}")
    files = touched(root, patch)
    expect(files, f"{patch.name}: touches no file")
    expect(limit is None or len(files) <= limit, f"{patch.name}: touches {len(files)} files, not up to {limit}: {files}")
    return len(files)


def check_all(root, patches):
    for kind, patch in patches.items():
        print(f"{kind}: {check_patch(root, patch, kind)} of {TOUCHES.get(kind, 0)} files")
    for kind in TOUCHES:
        expect(kind in patches, f"{EXAMPLES}/add_{kind}.patch: there is no example of this kind")


def copy_tree(root, target):
    """Copies the sources; unchanged files keep their times, so that a second run builds what the patches change."""
    skipped = {".git", "build", "__pycache__"}
    shutil.copytree(root, target, ignore=lambda folder, names: [n for n in names if n in skipped], dirs_exist_ok=True)


def build_all(root, patches, folder, cmake):
    source, build = folder / "source", folder / "build"
    shutil.rmtree(source, ignore_errors=True)
    copy_tree(root, source)
    # A repository of its own, or git would look for the files of a patch in one that stands around the folder.
    run("git", "init", "-q", source)
    for patch in patches.values():
        # Examples may stand beside each other in one list.
        result = run("git", "apply", "-C1", patch, cwd=source)
        expect(result.returncode == 0, f"{patch.name}: does not apply after the others: {result.stdout.strip()}")
    targets = sorted({"hpr"} | {target for patch in patches.values() for line in head_lines(patch, "Build")
                                for target in line.split()})
    jobs = str(len(os.sched_getaffinity(0)))
    generator = ["-G", "Ninja"] if shutil.which("ninja") else []
    for step in ([cmake, "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=RelWithDebInfo", *generator],
                 [cmake, "--build", build, "-j", jobs, "--target", *targets]):
        result = run(*step)
        if result.returncode != 0:
            sys.exit(f"{' '.join(map(str, step))} left with {result.returncode}\n{result.stdout[-6000:]}")

    checks = folder / "checks"
    shutil.rmtree(checks, ignore_errors=True)
    checks.mkdir()
    programs = [build / name for name in ("app", *sorted(p.name for p in build.iterdir() if p.is_dir()))]
    environment = dict(os.environ, PATH=os.pathsep.join(map(str, [*programs, os.environ.get("PATH", "")])))
    for patch in patches.values():
        for check in head_lines(patch, "Check"):
            result = subprocess.run(["bash", "-c", check], cwd=checks, env=environment, stdout=subprocess.PIPE,
                                    stderr=subprocess.STDOUT, text=True, errors="replace", timeout=600, check=False)
            print(f"{patch.name}: {check}: left with {result.returncode}")
            expect(result.returncode == 0, f"{patch.name}: the check failed:\n{result.stdout[-3000:]}")


def main():
    root = pathlib.Path(sys.argv[-1]).resolve()
    if shutil.which("git") is None:
        print("git is not installed")
        return 77
    patches = {p.stem.removeprefix("add_"): p for p in sorted((root / EXAMPLES).glob("add_*.patch"))}
    check_all(root, patches)
    if "--build" in sys.argv and not failures:
        at = sys.argv.index("--build")
        build_all(root, patches, pathlib.Path(sys.argv[at + 1]).resolve(), sys.argv[at + 2])
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
