#!/usr/bin/env python3
"""Every way to leave hpr that docs/commands.md names and that can be brought about here.

usage: exit_codes_test.py HPR

Each failure must give its exit code and one error of up to three lines, `hpr: error: WHAT`, the offending line and a
hint, and leave no file behind, partial or whole. Prints what was wrong and leaves with 1.
"""

import fcntl
import json
import os
import pathlib
import resource
import struct
import subprocess
import sys
import tempfile

HPR = os.path.abspath(sys.argv[1])
failures = []


def run(arguments, folder, environment=None, limit=None):
    return subprocess.run([HPR, *arguments], cwd=folder, capture_output=True, text=True, timeout=120, check=False,
                          env={**os.environ, **(environment or {})}, preexec_fn=limit)


def complain(case, result, message):
    failures.append(case)
    print(f"{case}: {message}\n  stdout: {result.stdout[-600:]!r}\n  stderr: {result.stderr[-1200:]!r}")


def error_lines(text):
    """The error's own lines: the one that names it and what is indented below it (mpiexec adds its own words)."""
    found = []
    for line in text.splitlines():
        if line.startswith("hpr: error:") or (found and line.startswith("  ")):
            found.append(line)
        elif found:
            break
    return found


def expect_error(case, arguments, codes, mentions=(), environment=None, prepare=None, folder=None, limit=None):
    """Runs hpr in a fresh folder (or `folder`) and expects one of `codes`, an orderly message and no new file."""
    with tempfile.TemporaryDirectory(prefix="hpr-exit-") as scratch:
        where = pathlib.Path(folder or scratch)
        if prepare:
            prepare(where)
        before = sorted(p.name for p in where.rglob("*"))
        result = run(arguments, where, environment, limit)
        after = sorted(p.name for p in where.rglob("*"))
    lines = [line for line in result.stderr.splitlines() if line.startswith("hpr: error:")]
    if result.returncode not in codes:
        complain(case, result, f"left with {result.returncode} instead of {' or '.join(map(str, codes))}")
    elif len(lines) != 1:
        complain(case, result, f"{len(lines)} lines start an error instead of one")
    elif len(error_lines(result.stderr)) > 3:
        complain(case, result, "more than three lines")
    elif after != before:
        complain(case, result, f"left files: {sorted(set(after) - set(before))}")
    else:
        for word in mentions:
            if word not in result.stderr:
                complain(case, result, f"does not say {word!r}")


def expect_finding(arguments, code, mention):
    """A wall that cannot be read at all is a finding of its check."""
    case = " ".join(arguments)
    with tempfile.TemporaryDirectory(prefix="hpr-exit-") as scratch:
        result = run(arguments, scratch)
    if result.returncode != code:
        complain(case, result, f"left with {result.returncode} instead of {code}")
    document = json.loads(result.stdout or "{}")
    if document.get("ok") is not False or mention not in document["findings"][0]["what"]:
        complain(case, result, f"no finding about {mention}")


def expect_success(case, arguments, prefix, prepare=None):
    with tempfile.TemporaryDirectory(prefix="hpr-exit-") as scratch:
        if prepare:
            prepare(pathlib.Path(scratch))
        result = run(arguments, scratch)
    if result.returncode != 0:
        complain(case, result, f"left with {result.returncode}")
    elif prefix not in result.stdout:
        complain(case, result, f"stdout does not say {prefix!r}")


def gltf(last_index):
    """A triangle whose third index is `last_index`; anything past 2 points outside its three vertices."""
    positions = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    binary = positions + struct.pack("<3H", 0, 1, last_index)
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "buffers": [{"uri": "triangle.bin", "byteLength": len(binary)}],
    }, binary


def write_gltf(last_index):
    def prepare(folder):
        document, binary = gltf(last_index)
        (folder / "triangle.gltf").write_text(json.dumps(document))
        (folder / "triangle.bin").write_bytes(binary)
    return prepare


def locker(name):
    """Makes a folder that another run writes into."""
    def prepare(folder):
        (folder / name).mkdir()
        held = os.open(folder / name, os.O_RDONLY)
        fcntl.flock(held, fcntl.LOCK_EX)
    return prepare


def folder_with(name, file):
    def prepare(folder):
        (folder / name).mkdir()
        (folder / name / file).write_text("old")
    return prepare


def writer(*files):
    """Writes files into a folder: a name, its text, a name, ..."""
    return lambda folder: [(folder / name).write_text(text) for name, text in zip(files[::2], files[1::2])]


TWICE = """hpr_wall = 1
name = "twice"
nodes = [{ id = "pc" }]
windows = [
  { id = "w0", node = "pc", display = ":0", rect = [0, 0, 64, 36] },
  { id = "w1", node = "pc", display = ":0", rect = [60, 30, 64, 36] },
]

[[surfaces]]
id = "wall"

[surfaces.grid]
columns = 2
rows = 1
tile_pixels = [64, 36]
tile_size_m = [0.64, 0.36]
windows = ["w0", "w1"]
"""

SMALL = ["--size", "64x48"]


def full_disk():
    """A file system of 16 KiB, so that a picture does not fit: needs root and the right to mount."""
    with tempfile.TemporaryDirectory(prefix="hpr-full-") as folder:
        mounted = os.geteuid() == 0 and subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=16k", "hpr-full", folder], capture_output=True, check=False).returncode == 0
        if not mounted:
            print("full disk: not tried, it needs the right to mount")
            return
        try:
            wall = ["wall", "run", "2x1@64x48", "gen:cornell", "--passes", "none", "--display", "pipe", "-o"]
            expect_error("full disk, frames", [*wall, f"{folder}/a.y4m"], [4], ["space", "hint"], folder=folder)
            expect_error("full disk", ["render", "gen:gallery", "--size", "320x256", "-o", f"{folder}/a.exr"], [4],
                         ["space"], folder=folder)
        finally:
            subprocess.run(["umount", folder], check=False)


def limited_files():
    """A limit of file sizes is no full disk, and no matter of permissions."""
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
    for arguments in (["render", "gen:gallery", "--size", "320x256", "-o", "a.png"],
                      ["wall", "run", "2x1@64x48", "gen:cornell", "--passes", "none", "--display", "pipe", "-o", "a.y4m"]):
        expect_error(f"limited files, {arguments[0]}", arguments, [4], ["ulimit -f"], limit=limit)


def backgrounds():
    """What a file cannot hold is told of where it is made."""
    for name, has_one in (("tetra", True), ("sphereflake", True), ("cornell", False)):
        with tempfile.TemporaryDirectory(prefix="hpr-exit-") as scratch:
            result = run(["scene", "make", name, "-o", "a.glb"], scratch)
        if result.returncode != 0 or ("background" in result.stderr) != has_one:
            complain(f"the background of {name}", result, "is not told of as it should")


def groups():
    """Of ranks that are not grouped, or are fewer, it is told that they are not as asked."""
    for ranks, distribution, told in (("2", "sort-last", "--distribute sort-last has no use for --groups"),
                                      ("2", "hybrid", "--groups 3"), ("1", "hybrid", "--groups 3"), ("3", "hybrid", None)):
        with tempfile.TemporaryDirectory(prefix="hpr-exit-") as scratch:
            result = run(["render", "gen:cornell", "-o", "a.png", *SMALL, "--passes", "none", "--groups", "3", "--distribute",
                          distribution, "--ranks", ranks], scratch)
        if result.returncode != 0 or (told or "") not in result.stderr or (told is None) == ("warning" in result.stderr):
            complain(f"--groups 3 of {ranks} ranks, {distribution}", result, "is not told of as it should")


def main():
    expect_success("a demo whose picture was taken away", ["demo", "--wall", "1x1@16x16"], "hpr-demo.png",
                   prepare=folder_with("hpr-demo-screens", "wall-r0c0.png"))
    expect_success("help", ["--help"], "render")
    expect_success("help command", ["help"], "render")
    expect_success("help of render", ["render", "--help"], "--size")
    expect_success("version", ["--version"], "hpr")

    for words in (["help", "help"], ["help", "help", "render"]):
        expect_success(" ".join(words), words, "--size" if "render" in words else "render")

    expect_error("unknown command", ["rendr"], [2], ["render"])
    expect_error("options and no command", ["-v"], [2], ["needs a command", "hint: choices: demo, render"])
    expect_error("a command without what it needs, behind an option", ["-v", "diff"], [2], ["A is required", "--help"])
    expect_error("unknown option", ["render", "gen:gallery", "-o", "a.png", "--sizee", "64x48"], [2], ["--size"])
    expect_error("no output named", ["render", "gen:gallery", *SMALL], [2])
    expect_error("size is no size", ["render", "gen:gallery", "-o", "a.png", "--size", "64by48"], [2], ["64by48"])
    expect_error("unknown backend", ["render", "gen:gallery", "-o", "a.png", *SMALL, "--backend", "nonsense"], [2],
                 ["egl", "osmesa"])
    expect_error("unknown strategy", ["render", "gen:gallery", "-o", "a.png", *SMALL, "--strategy", "tre"], [2], ["tree"])
    dense = ["compare", "--synthetic", "dense", "--size", "64x48", "--frames", "1"]
    expect_error("factors of another number of ranks", [*dense, "--ranks", "4", "--strategies", "radix-k:3"], [2],
                 ["radix-k:3", "4"])
    expect_error("factors of another number of ranks in a render",
                 ["render", "gen:cornell", "-o", "a.png", *SMALL, "--passes", "none", "--distribute", "sort-last", "--ranks", "3",
                  "--strategy", "radix-k:2"], [2], ["radix-k:2", "3"])
    expect_error("negative seed", ["render", "gen:cornell", "-o", "a.png", *SMALL, "--seed", "-1"], [2], ["-1"])
    expect_error("two results in one file", [*dense, "--ranks", "1", "-o", "k.png", "--raw", "./k.png"], [2], ["two results"])
    expect_error("a scene's file of another kind", ["scene", "make", "cornell", "-o", "c.gltf"], [2], [".glb"])
    expect_error("an empty list of passes", ["render", "gen:cornell", "-o", "a.png", *SMALL, "--passes", ","], [2], ["none"])
    for option in ("--environment", "--stats", "--aov", "--checkpoint", "--raw", "--passes", "--trace"):
        expect_error(f"an empty {option}", ["render", "gen:cornell", "-o", "a.png", *SMALL, option, ""], [2], [option])
    expect_error("tiles that do not fit", ["bench", "rays", "gen:cornell", "--side", "127"], [2], ["--side 64"])
    expect_error("options of displays elsewhere", ["wall", "run", "2x1@16x16", "gen:cornell", "--display", "none", "--codec", "raw"],
                 [2], ["--display remote"])
    for override in ("=3", "name=", "surfaces.0"):
        expect_error(f"--set {override}", ["wall", "check", "2x2", "--set", override], [2], [f"--set {override}", "hint"])
    for wall in ("0x2", "2x2@0x3"):
        expect_error(f"wall {wall}", ["wall", "check", wall], [2], [wall, "hint"])
    for wall in ("4097x1", "2x2@65537x1"):
        expect_error(f"wall {wall}", ["wall", "check", wall], [6], [wall, "hint"])
    expect_error("AOVs of a wall", ["wall", "run", "2x1@16x16", "gen:cornell", "--display", "none", "--aov", "id"], [2],
                 ["--display file"])
    expect_error("AOVs of a view", ["view", "gen:cornell", "--web", "--aov", "id"], [2], ["--display file"])
    if "--aov" in run(["view", "--help"], ".").stdout:
        failures.append("the help of view names --aov, which it refuses")
    expect_error("a --set nobody acts on", ["wall", "run", "2x1@16x16", "gen:cornell", "--display", "none", "--set",
                                            "render.strategy=tree"], [3], ["render"])
    expect_error("no factors", [*dense, "--ranks", "4", "--strategies", "tree,radix-k:2,x"], [2], ["x"])
    expect_error("sort-first without a scene", [*dense, "--ranks", "2", "--strategies", "sort-first"], [2], ["scene"])
    expect_error("unknown key of a cluster", [*dense, "--simulate", "hosts=2,latencey=2us"], [2], ["latency"])
    expect_error("fewer ranks than hosts", [*dense, "--simulate", "hosts=4,ranks=2"], [2], ["hosts"])
    expect_error("simulated ranks counted twice", [*dense, "--simulate", "hosts=1,ranks=2", "--ranks", "2"], [2],
                 ["--ranks"])
    expect_error("bench net of one rank", ["bench", "net", "--ranks", "1"], [2], ["two ranks"])
    expect_error("unknown distribution", ["render", "gen:gallery", "-o", "a.png", *SMALL, "--distribute", "sort-fist"],
                 [2], ["sort-first"])
    expect_error("unknown generator", ["render", "gen:galery", "-o", "a.png", *SMALL], [2], ["gallery"])
    expect_error("picture of unknown kind", ["render", "gen:gallery", "-o", "a.gif", *SMALL], [2], [".png"])

    expect_error("missing scene", ["render", "none.glb", "-o", "a.png", *SMALL], [4], ["none.glb"])
    expect_error("missing scene, two ranks", ["render", "none.glb", "-o", "a.png", *SMALL, "--ranks", "2"], [4],
                 ["none.glb"])
    expect_error("missing scene, wall's folder made", ["wall", "run", "2x1@16x16", "none.glb", "-o", "a/b"], [4],
                 ["none.glb"])
    expect_error("missing scene, wall's folder made, two ranks",
                 ["wall", "run", "2x1@16x16", "none.glb", "-o", "a/b", "--ranks", "2"], [4], ["none.glb"])
    expect_error("missing wall", ["wall", "check", "none.toml"], [4], ["none.toml"])
    expect_finding(["wall", "check", "none.toml", "--json"], 4, "none.toml")
    expect_finding(["wall", "check", "0x2", "--json"], 2, "0x2")
    expect_error("missing folder", ["render", "gen:gallery", "-o", "none/a.png", *SMALL], [4], ["none"])
    expect_error("a scene that would be replaced", ["render", "a.gltf", "-o", "a.png", *SMALL, "--stats", "a.gltf", "--force"], [2],
                 ["a.gltf"], prepare=writer("a.gltf", "precious"))
    named = '{"asset": {"version": "2.0"}, "images": [{"uri": "a.png"}]}'
    expect_error("a scene's picture that would be replaced", ["render", "b.gltf", "-o", "a.png", *SMALL, "--force"], [2],
                 ["a.png"], prepare=writer("a.png", "precious", "b.gltf", named))
    expect_error("a scene's picture that a wall would replace", ["wall", "run", "1x1@16x16", "b.gltf", "-o", ".", "--force"],
                 [2], ["wall-r0c0.png"],
                 prepare=writer("wall-r0c0.png", "precious", "b.gltf", named.replace("a.png", "wall-r0c0.png")))
    for ranks in ("1", "2"):
        expect_error(f"a folder another run writes into, {ranks} ranks",
                     ["wall", "run", "1x1@16x16", "gen:cornell", "-o", "out", "--force", "--ranks", ranks], [4], ["another run"],
                     prepare=locker("out"))
    expect_error("a path that a wall would replace",
                 ["wall", "run", "1x1@16x16", "gen:cornell", "-o", ".", "--frames", "2", "--path", "wall-r0c0.png", "--force"], [2],
                 ["wall-r0c0.png"], prepare=writer("wall-r0c0.png", "eye 0,1,4 at 0,1,0\n"))
    expect_error("a demo's name that holds something else", ["demo", "--wall", "1x1@16x16"], [4], ["--force"],
                 prepare=writer("hpr-demo.png", "precious"))
    expect_error("an environment that would be replaced",
                 ["render", "gen:cornell", "-o", "./a.png", *SMALL, "--environment", "a.png", "--force"], [2], ["a.png"],
                 prepare=writer("a.png", "precious"))
    expect_error("an eye nowhere", ["render", "gen:cornell", "-o", "a.png", *SMALL, "--eye", "1e300,0,0", "--at", "0,0,0"], [2],
                 ["finite"])
    expect_error("indirect light without photons", ["render", "gen:cornell", "-o", "a.png", *SMALL, "--indirect", "--photons", "0"],
                 [2], ["--indirect"])
    expect_error("existing picture", ["render", "gen:gallery", "-o", "a.png", *SMALL], [4], ["--force"],
                 prepare=writer("a.png", "precious"))

    expect_error("scene is no glTF", ["render", "a.glb", "-o", "a.png", *SMALL], [3], ["a.glb"],
                 prepare=writer("a.glb", "not a scene"))
    expect_error("index out of range", ["render", "triangle.gltf", "-o", "a.png", *SMALL], [3], ["triangle.gltf"],
                 prepare=write_gltf(3))
    expect_error("index out of range, three ranks", ["render", "triangle.gltf", "-o", "a.png", *SMALL, "--ranks", "3"],
                 [3], ["triangle.gltf"], prepare=write_gltf(3))
    expect_error("broken wall file", ["wall", "check", "wall.toml"], [3], ["wall.toml:3:"],
                 prepare=writer("wall.toml", "# a wall\n[wall]\nname = = 1\n"))
    expect_error("screens too small to draw", ["wall", "check", "wall.toml"], [3], ["tile_size_m"],
                 prepare=writer("wall.toml", TWICE.replace("[60, 30,", "[70, 30,").replace("[0.64, 0.36]", "[1e-200, 1e-200]")))
    expect_error("tile driven twice", ["wall", "check", "wall.toml"], [3], ["wall.toml:6:", "twice"],
                 prepare=writer("wall.toml", TWICE))

    expect_error("files of keys that hold none", ["diff", "a.keys", "b.keys"], [3], ["a.keys", "no keys", "hint"],
                 prepare=writer("a.keys", "", "b.keys", ""))
    expect_error("files of keys of another name", ["diff", "a.raw", "b.raw"], [3], ["a.raw", ".keys"],
                 prepare=writer("a.raw", "eight by", "b.raw", "eight by"))
    expect_error("a file of keys beside one of another name", ["diff", "a.keys", "b.raw"], [3], ["b.raw", "FILE.keys"],
                 prepare=writer("a.keys", "eight by", "b.raw", "eight by"))

    expect_error("picture past the limit", ["render", "gen:gallery", "-o", "a.png", "--size", "4096x4096", "--limit-image",
                                            "1024x1024"], [6], ["1024"])
    expect_error("scene past the limit", ["render", "triangle.gltf", "-o", "a.png", *SMALL, "--limit-mem", "16B"], [6],
                 prepare=write_gltf(2))

    expect_error("no graphics", ["render", "gen:gallery", "-o", "a.png", *SMALL, "--backend", "egl"], [5],
                 environment={"LIBGL_DRIVERS_PATH": "/none", "GBM_BACKENDS_PATH": "/none", "EGL_PLATFORM": "surfaceless"})
    for case, arguments in (("render", ["render", "gen:gallery", "-o", "a.png", *SMALL]), ("compare", dense),
                            ("wall", ["wall", "run", "2x1@16x16", "gen:cornell", "--display", "none"])):
        expect_error(f"ranks that cannot talk, {case}", [*arguments, "--ranks", "2"], [4], ["TMPDIR"],
                     environment={"OMPI_MCA_btl": "none-such"})
    for arguments in (["wall", "run", "2x1@16x16", "gen:cornell", "--display", "none"], ["demo", "--wall", "1x1@16x16"]):
        expect_error(f"no folder for temporary files, {arguments[0]}", [*arguments, "--ranks", "2"], [4],
                     ["'/nonexistent/folder', which TMPDIR names", "hint: set TMPDIR"],
                     environment={"TMPDIR": "/nonexistent/folder"})
    backgrounds()
    groups()
    full_disk()
    limited_files()

    with tempfile.TemporaryDirectory(prefix="hpr-exit-") as scratch:
        result = run(["render", "gen:gallery", "-o", "a.png", *SMALL], scratch)
        other = run(["render", "gen:gallery", "-o", "b.png", *SMALL, "--eye", "0,9,9", "--at", "0,0,0"], scratch)
        if result.returncode or other.returncode:
            complain("render", result if result.returncode else other, "left with a failure")
        else:
            same = run(["diff", "a.png", "a.png", "--fail", "0"], scratch)
            if same.returncode != 0:
                complain("diff of equal pictures", same, f"left with {same.returncode}")
            different = run(["diff", "a.png", "b.png", "--fail", "0"], scratch)
            if different.returncode != 1:
                complain("diff of different pictures", different, f"left with {different.returncode} instead of 1")

    print(f"{len(failures)} cases failed: {', '.join(failures)}" if failures else "every exit code is as documented")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
