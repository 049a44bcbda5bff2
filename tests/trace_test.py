#!/usr/bin/env python3
"""--trace: what ranks and threads did when, in Chrome's trace event format, and the same pictures as without.

usage: trace_test.py HPR

Prints what differs or is missing and leaves with 1.
"""

import json
import pathlib
import sys
import tempfile

from program import expect, failures, run


def hpr(folder, *arguments, code=0):
    result = run(folder, *arguments)
    expect(result.returncode == code, f"hpr {' '.join(arguments)} left with {result.returncode}: {result.stderr[-600:]}")
    return result


def trace_of(folder, ranks, *arguments):
    """The spans of each rank, after a look at what holds for every trace."""
    hpr(folder, *arguments, "--trace", "trace.json", "--force")
    document = json.loads((folder / "trace.json").read_text())
    about, events = document["otherData"], document["traceEvents"]
    expect(about["schema"] == "hpr.trace/1" and about["dropped"] == 0, f"about: {about}")
    expect(about["command"].startswith(f"hpr {arguments[0]}"), f"another command: {about['command']}")
    names = {e["pid"]: e["args"]["name"] for e in events if e["ph"] == "M" and e["name"] == "process_name"}
    expect(sorted(names) == list(range(ranks)), f"{arguments}: processes {names}")
    expect(all(names[rank].startswith(f"rank {rank} on ") for rank in names), f"names of processes: {names}")
    spans = [e for e in events if e["ph"] == "X"]
    expect(all(e["dur"] >= 0 and e["ts"] >= 0 for e in spans), "a span before the ranks met, or one that ends before it begins")
    rows = {(e["pid"], e["tid"]) for e in spans}
    told = {(e["pid"], e["tid"]) for e in events if e["ph"] == "M" and e["name"] == "thread_name"}
    expect(rows == told, f"rows without a name, or names without a row: {rows ^ told}")
    for row in rows:
        nested(sorted((e for e in spans if (e["pid"], e["tid"]) == row), key=lambda e: (e["ts"], -e["dur"])), row)
    return [[e for e in spans if e["pid"] == rank] for rank in range(ranks)]


def nested(spans, row):
    """In one row a span lies in another or beside it."""
    open_until = []
    for span in spans:
        end = span["ts"] + span["dur"]
        while open_until and open_until[-1] <= span["ts"] + 1e-3:
            open_until.pop()
        expect(not open_until or end <= open_until[-1] + 1e-3, f"row {row}: {span['name']} reaches past what it began in")
        open_until.append(end)


def names(spans):
    return {span["name"] for span in spans}


def counts_of(folder, *arguments):
    """What OpenGL drew of a picture, and its times."""
    hpr(folder, *arguments, "--stats", "a.json", "--force")
    return json.loads((folder / "a.json").read_text())["raster"]


def pictures(folder):
    base = ("render", "gen:gallery", "--size", "200x130", "-o", "a.png", "--spp", "2")
    raster = (*base, "--primary", "raster")
    hpr(folder, *raster)
    plain = (folder / "a.png").read_bytes()
    alone = trace_of(folder, 1, *raster, "--threads", "2")[0]
    expect((folder / "a.png").read_bytes() == plain, "a trace changes the picture")
    wanted = {"run", "load scene", "start OpenGL", "upload geometry", "prepare light", "build ray scene", "sample", "raster",
              "cull chunks", "draw triangles", "read keys", "pack keys",
              "photons", "light", "light tile", "write picture"}
    expect(wanted <= names(alone), f"one rank: no {wanted - names(alone)}")
    expect(all(s["args"]["pixels"] == 200 * 130 for s in alone if s["name"] == "read keys"), "pixels that are read")
    drawn = counts_of(folder, *raster)
    expect(drawn["pixels_read"] == 2 * 200 * 130 and drawn["triangles_drawn"] > drawn["chunks_drawn"] > 0, f"counts {drawn}")
    expect(all(drawn[f"{step}_ms"] > 0.0 for step in ("cull", "draw", "read", "pack")), f"times {drawn}")
    samples = sorted(s["args"]["number"] for s in alone if s["name"] == "sample")
    expect(samples == [0, 1], f"samples {samples}")
    tiles = sorted(s["args"]["tile"] for s in alone if s["name"] == "light tile")
    expect(tiles == sorted(2 * list(range(12))), f"tiles of 200x130, twice: {tiles}")
    expect({s["tid"] for s in alone if s["name"] == "light tile"} <= {0, 1}, "two threads light in other rows than 0 and 1")

    ranks = trace_of(folder, 3, *raster, "--ranks", "3", "--distribute", "sort-last", "--strategy", "binary-swap")
    expect((folder / "a.png").read_bytes() == plain, "a trace of 3 ranks changes the picture")
    for rank, spans in enumerate(ranks):
        expect({"raster", "composite", "exchange"} <= names(spans), f"rank {rank} does not composite: {names(spans)}")
        expect(any(s["args"]["bytes"] > 0 for s in spans if s["name"] == "exchange"), f"rank {rank} sends nothing")
    expect("write picture" in names(ranks[0]) and "write picture" not in names(ranks[1]), "who writes the picture")
    rays = trace_of(folder, 1, *base, "--primary", "rays")[0]
    expect({"primary rays", "trace tile"} <= names(rays) and "raster" not in names(rays), f"by rays: {names(rays)}")
    expect("start OpenGL" not in names(rays), "OpenGL starts for keys by rays")
    named = trace_of(folder, 1, *base, "--primary", "rays", "--backend", "egl")[0]
    expect("start OpenGL" in names(named), "a backend that is named is not tried")
    expect("path trace tile" in names(trace_of(folder, 1, *base, "--reference")[0]), "the reference traces no tile")


def other_commands(folder):
    wall = trace_of(folder, 2, "wall", "run", "2x1@64x48", "gen:cornell", "-o", "wall", "--frames", "3", "--ranks", "2")
    for rank, spans in enumerate(wall):
        expect([s["args"]["number"] for s in spans if s["name"] == "frame"] == [0, 1, 2], f"rank {rank}: other frames")
        expect("bring to screens" in names(spans), f"rank {rank}: {names(spans)}")
    expect("show" in names(wall[0]), "nobody shows the wall")
    compare = ("compare", "--synthetic", "dense", "--size", "256x128", "--strategies", "direct-send", "--frames", "2")
    last = trace_of(folder, 3, *compare, "--ranks", "2,3")  # of the jobs, the last
    expect(all({"composite", "collect"} <= names(spans) for spans in last), f"compare: {[names(spans) for spans in last]}")
    threads = ("--transport", "threads")
    for spans in trace_of(folder, 2, *compare, "--ranks", "2", *threads):
        expect({"composite", "exchange"} <= names(spans), f"ranks on threads: {names(spans)}")
    expect("run" in names(trace_of(folder, 1, "diff", "a.png", "a.png")[0]), "diff leaves no trace")


def refusals(folder):
    (folder / "there.json").write_text("kept")
    base = ("render", "gen:cornell", "--size", "32x32", "--spp", "1", "-o", "b.png", "--force")
    hpr(folder, *base[:-1], "--trace", "there.json", code=4)
    expect((folder / "there.json").read_text() == "kept" and not (folder / "b.png").exists(), "a refused trace leaves something")
    hpr(folder, *base, "--trace", "nowhere/trace.json", code=4)
    hpr(folder, *base, "--trace", "again.json")
    hpr(folder, "diff", "b.png", "b.png", "--trace", "again.json", code=4)
    steps = ("render", "gen:cornell", "--size", "32x32", "-o", "c.png", "--spp", "2", "--trace", "again.json")
    hpr(folder, *steps, code=4)
    going_on = hpr(folder, *steps, "--resume", code=4).stderr
    expect("c.png.checkpoint" in going_on and "again.json" not in going_on, f"--resume is refused for its trace: {going_on}")
    hpr(folder, *steps, "--ranks", "2", code=4)
    hpr(folder, *base, "--trace", "b.png", code=2)
    hpr(folder, *base, "--trace", "there.json", code=2)  # not even with --force: it is no trace
    expect((folder / "there.json").read_text() == "kept", "a file that is no trace was replaced")
    hpr(folder, "scene", "make", "tetra", "-o", "made.glb", "--trace", "made.glb", code=2)
    expect((folder / "made.glb").read_bytes()[:4] == b"glTF", "a trace took the place of the command's own result")
    hpr(folder, "render", "nothing.glb", "-o", "b.png", "--trace", "none.json", code=4)
    expect(not (folder / "none.json").exists(), "a run that failed leaves a trace")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-trace-") as scratch:
        pictures(pathlib.Path(scratch))
        other_commands(pathlib.Path(scratch))
        refusals(pathlib.Path(scratch))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
