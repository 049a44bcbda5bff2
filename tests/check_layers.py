#!/usr/bin/env python3
"""Holds the table of rooms: who may include whom, and how many files a folder has.

usage: check_layers.py [--self-test] ROOT

Every #include "folder/file" of our folders must be allowed by the table, and must exist; no folder holds more than
MAX_FILES sources. Prints one line per breach, `file:line: may not include folder/`, and leaves with 1.
docs/architecture.md and CONTRIBUTING.md say what each room is for.
"""

import collections
import pathlib
import re
import sys

MAX_FILES = 40

# A room is a folder with all below it, except for the rooms below it that are listed themselves. Each line names what a
# room may include beside itself.
ALLOWED = {
    "core": [],
    "image": ["core"],
    "scene": ["core", "image"],
    "cluster/transport": ["core"],
    "cluster/distribution": ["core", "image", "scene", "cluster/transport"],
    "raster": ["core", "image", "scene"],
    "gpu": ["core", "image", "scene", "rt"],
    "compositing": ["core", "image", "cluster/transport"],
    "rt": ["core", "image", "scene", "cluster/transport"],
    "walls": ["core", "image", "scene", "cluster/transport"],
    "engine": ["core", "image", "scene", "cluster/transport", "cluster/distribution", "raster", "compositing", "rt",
               "gpu"],
}
ALLOWED["engine/wall"] = ALLOWED["engine"] + ["engine", "walls"]
ALLOWED["app"] = ALLOWED["engine/wall"] + ["engine/wall"]
ALLOWED["app/commands"] = ALLOWED["app"] + ["app"]
ALLOWED["tools"] = ALLOWED["app"] + ["app"]
ALLOWED["tests"] = ALLOWED["tools"] + ["tools", "app/commands"]
ALLOWED["bench"] = ALLOWED["tools"] + ["tools"]

# What a room's tests need beyond that.
ALLOWED_IN_TESTS = {"rt": ["cluster/distribution"]}

# Headers of ours that a room must stay free of.
FORBIDDEN = {"engine": ["core/json.h"], "engine/wall": ["core/json.h"]}

# Libraries that one file alone includes, because every other one would take seconds longer to compile.
ONLY_IN = {"CLI/": "app/options/option_set.cpp", "nlohmann/": "core/json.cpp"}

TOP_FOLDERS = sorted({room.split("/")[0] for room in ALLOWED})
INCLUDE = re.compile(r'^\s*#\s*include\s*(["<])([^">]+)[">]')
SOURCES = {".h", ".cpp"}


def room_of(path):
    """The innermost room that a path, relative to the root, stands in; None: in none of ours."""
    parts = path.split("/")[:-1]
    while parts:
        if "/".join(parts) in ALLOWED:
            return "/".join(parts)
        parts.pop()
    return None


def may_include(path, target):
    """Whether the file at `path` may include the file `target`, both relative to the root."""
    room, other = room_of(path), room_of(target)
    if room == other or other in ALLOWED[room]:
        return True
    return path.endswith("_test.cpp") and other in ALLOWED_IN_TESTS.get(room, [])


def breaches_of(path, text, exists):
    """Lines of complaint about one file; `path` is relative to the root, `exists` answers whether a file is there."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quote, name = match.groups()
        ours = name.split("/")[0] in TOP_FOLDERS and "/" in name
        if name in FORBIDDEN.get(room_of(path), []):
            found.append(f"{path}:{number}: {room_of(path)}/ stays free of {name}")
        if quote == "<":
            if ours and exists(name):
                found.append(f'{path}:{number}: our own headers are included with quotes: "{name}"')
            for library, home in ONLY_IN.items():
                if name.startswith(library) and path != home:
                    found.append(f"{path}:{number}: only {home} includes <{name}>")
            continue
        if not ours:
            found.append(f'{path}:{number}: includes start at the repository root: "{name}"')
        elif not exists(name):
            found.append(f'{path}:{number}: there is no "{name}"')
        elif room_of(name) is None or not may_include(path, name):
            found.append(f"{path}:{number}: may not include {room_of(name) or name.rsplit('/', 1)[0]}/")
    return found


def check(root):
    breaches = []
    files = collections.Counter()
    for folder in TOP_FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix not in SOURCES:
                continue
            path = file.relative_to(root).as_posix()
            files[path.rsplit("/", 1)[0]] += 1
            if room_of(path) is None:
                breaches.append(f"{path}: stands in no room of tests/check_layers.py")
                continue
            breaches += breaches_of(path, file.read_text(), lambda name: (root / name).is_file())
    breaches += [f"{folder}/: {count} files, more than {MAX_FILES}" for folder, count in files.items() if count > MAX_FILES]
    for breach in breaches:
        print(breach)
    if not files:
        print(f"{root}: no sources found")
        return 1
    return 1 if breaches else 0


def self_test():
    def complaints(path, line):
        return breaches_of(path, line, lambda name: name != "core/gone.h")

    assert complaints("compositing/x.h", '#include "raster/y.h"') == ["compositing/x.h:1: may not include raster/"]
    assert complaints("image/x.cpp", '  # include "scene/scene.h"'), "spaces do not hide an include"
    assert complaints("core/x.h", '#include "image/image.h"')
    assert complaints("rt/lights/x.h", '#include "raster/y.h"')
    assert complaints("walls/link/x.h", '#include "app/launch/launcher.h"')
    assert complaints("compositing/strategies/x.h", '#include "cluster/distribution/assignment.h"')
    assert complaints("cluster/transport/x.h", '#include "scene/scene.h"')
    assert complaints("engine/x.h", '#include "walls/config/wall.h"'), "the engine knows no walls"
    assert complaints("engine/x.cpp", '#include "core/json.h"')
    assert complaints("tools/x_test.cpp", "#include <nlohmann/json.hpp>")
    assert complaints("app/x.cpp", "#include <CLI/CLI.hpp>")
    assert not complaints("core/json.cpp", "#include <nlohmann/json.hpp>")
    assert complaints("tools/diff/x.h", '#include "app/commands/y.h"')
    assert complaints("app/console/x.h", '#include "tools/diff/diff.h"')
    assert complaints("rt/x.cpp", '#include "cluster/distribution/assignment.h"')
    assert complaints("core/x.cpp", '#include "x.h"'), "includes start at the root"
    assert complaints("app/x.cpp", '#include "core/gone.h"')
    assert complaints("app/x.cpp", "#include <core/error.h>")
    assert not complaints("rt/x_test.cpp", '#include "cluster/distribution/assignment.h"')
    assert not complaints("rt/x.cpp", '#include "cluster/transport/communicator.h"\n#include "rt/y.h"\n#include <mpi.h>')
    assert not complaints("engine/wall/x.h", '#include "walls/config/wall.h"')
    assert not complaints("engine/frame.cpp", '#include "raster/y.h"')
    assert not complaints("core/x.h", '// #include "image/image.h"')
    return 0


if __name__ == "__main__":
    if "--self-test" in sys.argv:
        sys.exit(self_test())
    sys.exit(check(pathlib.Path(sys.argv[1])))
