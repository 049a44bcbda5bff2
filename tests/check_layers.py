#!/usr/bin/env python3
"""Holds docs/architecture.md's table of who may include whom.

usage: check_layers.py [--self-test] ROOT

Every #include "folder/file" of our folders must be allowed by the table, and must exist. Prints one line per breach,
`file:line: may not include folder/`, and leaves with 1.
"""

import pathlib
import re
import sys

ALLOWED = {
    "core": set(),
    "image": {"core"},
    "scene": {"core", "image"},
    "cluster": {"core", "image", "scene"},
    "raster": {"core", "image", "scene"},
    "compositing": {"core", "image", "cluster"},
    "rt": {"core", "image", "scene", "cluster"},
    "walls": {"core", "image", "scene", "cluster"},
}
EVERYTHING = set(ALLOWED) | {"app"}
ALLOWED |= {"app": EVERYTHING, "tests": EVERYTHING | {"tests"}, "bench": EVERYTHING | {"bench"}}

INCLUDE = re.compile(r'^\s*#\s*include\s*(["<])([^">]+)[">]')
SOURCES = {".h", ".cpp"}


def breaches_of(path, text, exists):
    """Lines of complaint about one file; `path` is relative to the root, `exists` tells whether a file is there."""
    folder = path.parts[0]
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quote, name = match.groups()
        target = name.split("/")[0]
        if quote == "<":
            if target in ALLOWED and "/" in name and exists(name):
                found.append(f'{path}:{number}: our own headers are included with quotes: "{name}"')
            continue
        if target not in ALLOWED or "/" not in name:
            found.append(f'{path}:{number}: includes start at the repository root: "{name}"')
        elif target != folder and target not in ALLOWED[folder]:
            found.append(f"{path}:{number}: may not include {target}/")
        elif not exists(name):
            found.append(f'{path}:{number}: there is no "{name}"')
    return found


def check(root):
    breaches = []
    files = 0
    for folder in ALLOWED:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix in SOURCES:
                files += 1
                breaches += breaches_of(file.relative_to(root), file.read_text(), lambda name: (root / name).is_file())
    for breach in breaches:
        print(breach)
    if files == 0:
        print(f"{root}: no sources found")
        return 1
    return 1 if breaches else 0


def self_test():
    def complaints(path, line):
        return breaches_of(pathlib.PurePosixPath(path), line, lambda name: name != "core/gone.h")

    assert complaints("compositing/x.h", '#include "raster/y.h"') == ["compositing/x.h:1: may not include raster/"]
    assert complaints("image/x.cpp", '  # include "scene/scene.h"'), "spaces do not hide an include"
    assert complaints("core/x.h", '#include "image/image.h"')
    assert complaints("rt/x.h", '#include "raster/y.h"')
    assert complaints("walls/x.h", '#include "app/command.h"')
    assert complaints("core/x.cpp", '#include "x.h"'), "includes start at the root"
    assert complaints("app/x.cpp", '#include "core/gone.h"')
    assert complaints("app/x.cpp", "#include <core/error.h>")
    assert not complaints("rt/x.cpp", '#include "cluster/communicator.h"\n#include "rt/y.h"\n#include <mpi.h>')
    assert not complaints("app/frame.cpp", '#include "raster/y.h"')
    assert not complaints("core/x.h", '// #include "image/image.h"')
    return 0


if __name__ == "__main__":
    if "--self-test" in sys.argv:
        sys.exit(self_test())
    sys.exit(check(pathlib.Path(sys.argv[1])))
