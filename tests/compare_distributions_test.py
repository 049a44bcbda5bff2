#!/usr/bin/env python3
"""`hpr compare SCENE --distribute`: whole frames of every distribution beside each other, the same bits by all.

usage: compare_distributions_test.py HPR

Times are no test. Prints what was wrong and leaves with 1.
"""

import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

import png
from program import HPR, expect, failures, run
from xxh64 import xxh64

SCENE = ["compare", "gen:cornell", "--frames", "2", "--warmup", "1"]
SMALL = ["--size", "150x100"]
STAGES = ("ms_draw", "ms_exchange", "ms_composite", "ms_light")


def rows_of(result):
    if not expect(result.returncode == 0, f"left with {result.returncode}: {result.stderr}"):
        return []
    report = json.loads(result.stdout)
    expect(report["schema"] == "hpr.compare/1", report["schema"])
    return report["runs"]


def check_rows(rows, ranks, transport, memory_of):
    expect([row["ranks"] for row in rows] == sorted(row["ranks"] for row in rows), "rows by ranks")
    for row in rows:
        case = f"{row['distribution']} on {row['ranks']}"
        expect(row["ranks"] in ranks and row["transport"] == transport and row["frames"] == 2, f"{case}: {row}")
        expect(0 < row["ms"]["min"] <= row["ms"]["median"] <= row["ms"]["p95"] <= row["ms"]["max"], f"{case}: {row['ms']}")
        stages = [row[stage]["median"] for stage in STAGES]
        expect(min(stages) >= 0 and row["ms_draw"]["median"] > 0 and row["ms_light"]["median"] > 0, f"{case}: {stages}")
        expect(sum(stages) <= 1.02 * row["ms"]["max"], f"{case}: stages add up to more than the frame: {row}")
        expect(row["ms_collect"]["median"] <= row["ms_exchange"]["median"], f"{case}: {row}")
        expect(row["imbalance"] >= 1, f"{case}: {row['imbalance']}")
        expect((row["bytes_total"] > 0) == (row["messages_total"] > 0) == (row["ranks"] > 1), f"{case}: {row}")
        expect(row["bytes_max_rank"] <= row["bytes_total"], f"{case}: {row}")
        expect(len(row["memory_peak_bytes_per_rank"]) == row["ranks"], f"{case}: {row}")
        expect(min(row["memory_peak_bytes_per_rank"]) > 1 << 20 and row["memory_of"] == memory_of, f"{case}: {row}")
        expect(row["differing_pixels"] == 0, f"{case}: {row['differing_pixels']} pixels differ")
        expect(row["predicted_ms"] is None or row["predicted_ms"] > 0, f"{case}: {row['predicted_ms']}")
        expect(("chosen" in row) == (row["distribution"] == "auto"), f"{case}: {row}")


def everything(folder):
    """By MPI jobs: all reports, and the frame is the one that render draws."""
    picture = [*SMALL, "--spp", "2", "--eye", "0.5,0.5,1.5", "--at", "0.5,0.4,0"]
    result = run(folder, *SCENE, *picture, "--distribute", "all", "--ranks", "1,3", "--json", "--csv", "r.csv", "--html", "r.html",
                 "-o", "c.png", "--raw", "c.keys")
    rows = rows_of(result)
    names = [row["distribution"] for row in rows if row["ranks"] == 1]
    listed = run(folder, "render", "gen:tetra", "-o", "x.png", "--distribute", "no")
    for name in names:
        expect(name in listed.stderr, f"render has no {name}")
    expect(set(names) >= {"sort-first", "sort-last", "hybrid", "auto"}, f"distributions: {names}")
    expect([row["distribution"] for row in rows] == 2 * names, f"rows: {rows}")
    check_rows(rows, (1, 3), "mpi", "rank")
    expect(len({row["frame_xxh64"] for row in rows} | {row["picture_xxh64"] for row in rows}) == 2, "frames differ")
    by_name = {row["distribution"]: row for row in rows if row["ranks"] == 3}
    expect(by_name["sort-first"]["strategy"] == "none", "sort-first composites")
    expect(by_name["sort-last"]["strategy"] == "shared-memory", f"strategy: {by_name['sort-last']['strategy']}")

    with (folder / "r.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    expect(len(lines) == len(rows) and all(None not in line for line in lines), "a line per row")
    expect(float(lines[0]["ms_light_median"]) > 0 and int(lines[0]["memory_peak_bytes_max_rank"]) > 1 << 20, f"{lines[0]}")
    page = xml.etree.ElementTree.parse(folder / "r.html").getroot()
    plots = page.findall(".//{http://www.w3.org/2000/svg}svg")
    expect(len(plots) == 2, f"{len(plots)} plots")
    expect(len(page.findall(".//tbody/tr")) == len(rows), "a row per run in the page")
    texts = [text.text for plot in plots[:1] for text in plot.iter("{http://www.w3.org/2000/svg}text")]
    expect({"1 rank", "3 ranks", "draw", "light", *names} - {"auto"} <= set(texts), f"names in the plot: {texts}")

    drawn = run(folder, "render", "gen:cornell", *picture, "-o", "r.png", "--raw", "r.keys")
    expect(drawn.returncode == 0, drawn.stderr)
    expect((folder / "c.keys").read_bytes() == (folder / "r.keys").read_bytes(), "other keys than those of render")
    diff = run(folder, "diff", "c.png", "r.png", "--json")
    expect(json.loads(diff.stdout)["rmse"] == 0, f"another picture than that of render: {diff.stdout}")


def on_threads(folder):
    """Settings reach the frames, and a table says whose memory it is."""
    threads = [*SCENE, *SMALL, "--transport", "threads", "--ranks", "3"]
    walls = rows_of(run(folder, *threads, "--tiles", "2x2", "--distribute", "sort-last,hybrid", "--strategy", "radix-k", "--groups", "3",
                        "--balance", "static", "--json"))
    check_rows(walls, (3,), "threads", "process")
    expect([(row["distribution"], row["strategy"]) for row in walls] == [("sort-last", "radix-k"), ("hybrid", "none")],
           f"groups of one composite nothing: {walls}")
    expect(len({row["memory_peak_bytes_per_rank"][0] for row in walls[:1]}) == 1, "one process")
    text = run(folder, *threads, "--distribute", "auto,sort-last,auto", "--trace", "t.json")
    expect(text.returncode == 0, text.stderr)
    lines = text.stdout.splitlines()
    expect([line.split()[0] for line in lines[2:4]] == ["auto", "sort-last"] and "auto (" in lines[2], f"table: {text.stdout}")
    expect("one process" in lines[-1], f"whose memory: {text.stdout}")
    expect(len(json.loads((folder / "t.json").read_text())["traceEvents"]) > 10, "an empty trace")
    parts = rows_of(run(folder, *threads, "--distribute", "all", "--data", "partitioned", "--json"))
    expect({row["distribution"] for row in parts} == {"sort-last", "hybrid", "auto"}, f"what partitioned data excludes is left out: {parts}")
    expect(all(row["differing_pixels"] == 0 for row in parts), f"{parts}")
    small = rows_of(run(folder, *threads, "--distribute", "sort-last", "--resolution-scale", "0.5", "--shading", "local", "--json"))
    expect([row["frame_xxh64"] == row["picture_xxh64"] for row in small] == [False], f"colors of keys are the picture: {small}")


def walls(folder):
    """The screens stand where a wall has them."""
    made = rows_of(run(folder, *SCENE, *SMALL, "--tiles", "3x2", "--transport", "threads", "--ranks", "2", "--distribute", "hybrid,sort-last",
                       "--json", "-o", "c.png", "--primary", "rays"))
    expect(len({row["picture_xxh64"] for row in made}) == 1, f"pictures differ: {made}")
    drawn = run(folder, "wall", "run", "3x2@150x100", "gen:cornell", "--spp", "1", "--quality", "draft", "--primary", "rays", "--display", "file",
                "-o", "wall")
    expect(drawn.returncode == 0, drawn.stderr)
    shown = [screen["xxh64"] for screen in json.loads((folder / "wall" / "manifest.json").read_text())["frames"][0]["screens"]]
    drawn = run(folder, *SCENE, *SMALL, "--tiles", "3x2", "--transport", "threads", "--ranks", "2", "--distribute", "sort-first", "--quality",
                "draft", "--primary", "rays", "-o", "d.png")
    expect(drawn.returncode == 0, drawn.stderr)
    width, height, pixels = png.read(folder / "d.png")
    expect((width, height) == (450, 200), f"{width}x{height}")
    screens = []
    for row in range(2):
        for column in range(3):
            lines = [4 * (width * y + 150 * column) for y in range(100 * row, 100 * row + 100)]
            screens.append(xxh64(b"".join(pixels[line:line + 600] for line in lines)))
    expect(screens == shown, f"other screens than those of wall run: {screens}, {shown}")


def inside_a_job(folder):
    mpiexec = shutil.which("mpiexec")
    result = subprocess.run([mpiexec, "--allow-run-as-root", "--oversubscribe", "-n", "3", HPR, *SCENE, *SMALL, "--distribute",
                             "hybrid,sort-first", "--json", "--raw", "j.keys"], cwd=folder, capture_output=True, text=True,
                            timeout=120, check=False)
    rows = rows_of(result)
    expect([row["distribution"] for row in rows] == ["hybrid", "sort-first"], f"rows: {rows}")
    for row in rows:
        expect(row["memory_of"] in ("rank", "job"), f"memory of {row['memory_of']}")
        row["memory_of"] = "rank"
    check_rows(rows, (3,), "mpi", "rank")
    expect((folder / "j.keys").stat().st_size == 150 * 100 * 8, "keys")


def refused(folder):
    frames = ["compare", "gen:cornell", *SMALL, "--distribute"]
    for words, code, mention in (([*frames, "sort-lst"], 2, "did you mean 'sort-last'"), ([*frames, "all,hybrid"], 2, "alone"),
                                 ([*frames, "all", "--strategies", "tree"], 2, "--strategy NAME"),
                                 ([*frames, "all", "--operator", "over8"], 2, "--operator"),
                                 ([*frames, "all", "--simulate", "hosts=2,ranks=4"], 2, "--simulate"),
                                 ([*frames, "all", "--spp", "until:1s"], 2, "--spp 16"),
                                 ([*frames, "sort-first", "--data", "partitioned"], 2, "sort-last"),
                                 ([*frames, "all", "--strategy", "tre"], 2, "did you mean 'tree'"),
                                 ([*frames, "all", "--raw", "x.keys", "--shading", "local"], 2, "--shading deferred"),
                                 ([*frames, "all", "-o", "x.exr"], 2, ".png"),
                                 ([*frames, "all", "--limit-image", "100x100"], 6, "--limit-image"),
                                 (["compare", *SMALL, "--synthetic", "dense", "--distribute", "all"], 2, "--synthetic"),
                                 (["compare", *SMALL, "--distribute", "all"], 2, "name a scene"),
                                 (["compare", "gen:cornell", *SMALL, "--spp", "4"], 2, "--distribute all")):
        result = run(folder, *words)
        expect(result.returncode == code, f"{words}: left with {result.returncode}: {result.stderr}")
        expect("hint:" in result.stderr and mention in result.stderr, f"{words}: {result.stderr}")
    expect(not list(folder.iterdir()), "left a file")
    missing = run(folder, "compare", "nothing.glb", "--distribute", "all", "--ranks", "1,2")
    expect(missing.returncode == 4 and missing.stderr.count("error:") == 1, f"a missing scene: {missing.stderr}")


def main():
    for case in (everything, on_threads, walls, inside_a_job, refused):
        with tempfile.TemporaryDirectory(prefix="hpr-distributions-") as scratch:
            case(pathlib.Path(scratch))
    print(f"{len(failures)} failed" if failures else "all distributions make one frame")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
