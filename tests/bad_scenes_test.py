#!/usr/bin/env python3
"""Runs `hpr scene validate` over the corpus of hostile and broken glTF files and checks every verdict.

usage: bad_scenes_test.py HPR [SCENES]

SCENES holds bad/manifest.json; by default $HPR_SCENES, else ../shared/scenes beside the repository. Exit code 77 when
there is none. For every file: an `error` verdict is exit code 3 (bad input), 4 (cannot read) or 6 (a limit) with at most
three lines on stderr; `warn` is 0 with a warning on stderr; `ok` is 0 without. No signal, at most 10 s and 1 GiB.
"""

import json
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile
import threading

ERROR_CODES = {3, 4, 6}


def run_limited(command, seconds, rss_bytes):
    """Returns (exit code, stderr, fault): fault is a sentence about a broken limit, or empty."""
    with tempfile.TemporaryFile() as captured:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=captured)
        timer = threading.Timer(seconds, process.kill)
        timer.start()
        # wait4 instead of wait: it also tells the peak memory of this very child.
        _, status, usage = os.wait4(process.pid, 0)
        late = not timer.is_alive()
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        captured.seek(0)
        errors = captured.read().decode("utf-8", "replace")
    fault = ""
    if late:
        fault = f"took longer than {seconds} s"
    elif process.returncode < 0:
        fault = f"died of signal {-process.returncode}"
    elif usage.ru_maxrss * 1024 > rss_bytes:
        fault = f"used {usage.ru_maxrss // 1024} MiB"
    return process.returncode, errors, fault


def check(hpr, path, accept, limits, expected_codes=None):
    """One sentence about what is wrong with the program's behaviour on `path`, or an empty one."""
    code, errors, fault = run_limited([hpr, "scene", "validate", str(path)], limits["seconds"], limits["rss_bytes"])
    if fault:
        return fault
    lines = errors.splitlines()
    if code == 0:
        verdict = "warn" if lines else "ok"
    elif code in ERROR_CODES:
        verdict = "error"
        if len(lines) > 3:
            return f"the error has {len(lines)} lines"
        if not lines or "error:" not in lines[0]:
            return f"the error is not on the first line: {errors[:200]!r}"
    else:
        return f"exit code {code}: {errors[:200]!r}"
    if verdict not in accept:
        return f"is taken as {verdict}, expected {' or '.join(accept)}: {errors[:200]!r}"
    if expected_codes and code not in expected_codes:
        return f"exit code {code}, expected {expected_codes}"
    if any(ord(c) < 0x20 and c not in "\n\t" or c == "\x7f" for c in errors):
        return "its message holds control characters"
    return ""


def setup_case(name, recipe, folder, bad):
    """Creates one of the manifest's `setup` cases in `folder`; returns the file to load, or None where impossible."""
    path = folder / name
    if recipe == "mkfifo":
        os.mkfifo(path)
    elif recipe.startswith("symlink:"):
        os.symlink(recipe.split(":", 1)[1], path)
    elif recipe.startswith("chmod:"):
        if os.geteuid() == 0:
            return None
        shutil.copy(bad / "ok_control.gltf", path)
        path.chmod(int(recipe.split(":")[1], 8))
    elif recipe == "absent":
        pass
    elif recipe.startswith("symlink of tri.bin"):
        path = folder / "setup_symlink_out.gltf"
        document = json.loads((bad / "ok_control.gltf").read_text())
        document["buffers"][0]["uri"] = "tri.bin"
        path.write_text(json.dumps(document))
        os.symlink("/etc/passwd", folder / "tri.bin")
    elif recipe == "truncate while reading":
        # Nobody can truncate at the right moment from outside; a file that ends early is what the reader then sees.
        whole = (bad / "ok_control.glb").read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
    else:
        return None
    return path


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    hpr = str(pathlib.Path(sys.argv[1]).resolve())
    repository = pathlib.Path(__file__).resolve().parent.parent
    scenes = pathlib.Path(
        sys.argv[2] if len(sys.argv) > 2 else os.environ.get("HPR_SCENES", repository / ".." / "shared" / "scenes")
    )
    bad = scenes / "bad"
    if not (bad / "manifest.json").exists():
        print(f"skipped: there is no {bad}/manifest.json; name the scenes' folder in HPR_SCENES")
        return 77
    # A runaway allocation ends in an exception in the program instead of taking the machine down.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    manifest = json.loads((bad / "manifest.json").read_text())
    limits = manifest["limits"]

    failures = []
    count = 0
    for entry in manifest["files"]:
        count += 1
        fault = check(hpr, bad / entry["file"], entry["accept"], limits)
        if fault:
            failures.append(f"{entry['file']} ({entry['wrong']}): {fault}")
    with tempfile.TemporaryDirectory() as temporary:
        for entry in manifest["setup"]:
            folder = pathlib.Path(tempfile.mkdtemp(dir=temporary))
            path = setup_case(entry["file"], entry["setup"], folder, bad)
            if path is None:
                print(f"left out: {entry['file']} (not possible as this user)")
                continue
            count += 1
            accept = ["error", "warn"] if entry["expect"] == "error-or-warn" else [entry["expect"]]
            fault = check(hpr, path, accept, limits)
            if fault:
                failures.append(f"{entry['file']} ({entry['wrong']}): {fault}")
    for failure in failures:
        print(failure)
    print(f"{count - len(failures)} of {count} files behave as the manifest says")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
