#!/usr/bin/env python3
"""No program that was built or is installed looks for libraries in the current folder, and all are hardened.

usage: hardening_test.py HPR BUILD CMAKE

Reads every program and shared object by readelf (skipped without): each part of a RUNPATH starts at the root or at the
program's own folder; what is loaded is read-only, its place is random, stacks are guarded and hold no code, jumps lead
to marked places. Then hpr runs in a folder with a false copy of each of its libraries.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

from program import HPR, expect, failures

BUILD, CMAKE = pathlib.Path(sys.argv[2]), sys.argv[3]
OTHERS = {"_deps", "CMakeFiles", "Testing", "touch_counts", "hpr_test_headers"}


def read_elf(path):
    """What readelf prints of headers, segments, the dynamic section, notes and symbols."""
    return subprocess.run(["readelf", "-W", "-h", "-l", "-d", "-n", "--dyn-syms", str(path)], capture_output=True,
                          text=True, timeout=60, check=True).stdout


def programs(root):
    for path in sorted(root.rglob("*")):
        if path.is_symlink() or not path.is_file() or OTHERS & set(path.relative_to(root).parts):
            continue
        if path.suffix in (".o", ".a", ".gch"):
            continue
        with path.open("rb") as file:
            if file.read(4) == b"\x7fELF":
                yield path


def bad_parts(elf):
    """The parts of search paths for libraries that are not the same wherever the program is started."""
    return [part for path in re.findall(r"\((?:RUNPATH|RPATH)\).*?\[(.*)\]", elf) for part in path.split(":")
            if not re.match(r"/|\$ORIGIN(/|$)|\$\{ORIGIN\}(/|$)", part)]


def missing(path, elf):
    """What a program lacks of what makes mistakes in memory hard to use."""
    lacks = []
    if not re.search(r"Type:\s+DYN", elf):
        lacks.append("a random place")
    if "GNU_RELRO" not in elf or not re.search(r"BIND_NOW|\bNOW\b", elf):
        lacks.append("full RELRO")
    if not re.search(r"GNU_STACK\s.*\sRW\s", elf):
        lacks.append("a stack without code")
    if "__stack_chk_fail" not in elf:
        lacks.append("guarded stacks")
    # The linker notes CET only where the system's own start-up code has it, which Debian 12's has not.
    if re.search(r"Machine:.*X86-64", elf) and b"\xf3\x0f\x1e\xfa" not in path.read_bytes():
        lacks.append("marks of where jumps may go (CET)")
    return lacks


def check_programs(root, least):
    found = list(programs(root))
    expect(len(found) >= least, f"{root}: {len(found)} programs, expected {least} or more")
    for path in found:
        elf = read_elf(path)
        expect(not bad_parts(elf), f"{path} looks for libraries in {bad_parts(elf)}")
        expect(not missing(path, elf), f"{path} lacks {', '.join(missing(path, elf))}")
    return found


def check_false_libraries(hpr, folder):
    """A library that is found in the current folder would end the program: none of them is one."""
    needed = re.findall(r"\(NEEDED\).*?\[(.*)\]", read_elf(hpr))
    expect(len(needed) > 10, f"{hpr} needs {needed}")
    for name in [*needed, "libhpr_imageio.so", "libOSMesa.so.8"]:
        (folder / name).write_bytes(b"\x7fELF, but not really")
    for command in (["--version"], ["render", "gen:cornell", "--size", "8x8", "-o", "a.exr", "--primary", "raster", "--force"]):
        result = subprocess.run([hpr, *command], cwd=folder, capture_output=True, text=True, timeout=60, check=False)
        expect(result.returncode == 0, f"{hpr} {command} beside false libraries left with {result.returncode}: "
                                       f"{result.stderr[-500:]}")


def main():
    if shutil.which("readelf") is None:
        print("skipped: there is no readelf")
        return 77
    expect(bad_parts(" (RUNPATH)  Library runpath: [/usr/lib:]") == [""], "an empty part is not seen")
    expect(bad_parts(" (RPATH)  Library rpath: [lib:$ORIGIN/../lib]") == ["lib"], "a relative part is not seen")
    check_programs(BUILD, 10)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        installed = subprocess.run([CMAKE, "--install", str(BUILD), "--prefix", str(folder / "installed")],
                                   capture_output=True, text=True, timeout=100, check=False)
        expect(installed.returncode == 0, f"cmake --install: {installed.stderr}")
        check_programs(folder / "installed", 2)
        elsewhere = folder / "elsewhere"
        elsewhere.mkdir()
        for hpr in (HPR, str(folder / "installed" / "bin" / "hpr")):
            check_false_libraries(hpr, elsewhere)
    return 1 if failures else 0


sys.exit(main())
