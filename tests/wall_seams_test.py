#!/usr/bin/env python3
"""Filters go on across screens that touch: no step at a seam of a gapless wall, the same bits on any number of ranks, and
walls with gaps as if each screen were alone.

usage: wall_seams_test.py HPR

Prints what differs and leaves with 1.
"""

import pathlib
import shutil
import statistics
import sys
import tempfile

import png
from program import expect, failures, run

SCENE = "gen:cornell"
PIXEL = 0.005  # metres
# Screens in pixels, [left, top, width, height]: rows, columns, both, and of several sizes that meet in the middle of edges.
WALLS = {
    "rows": [[0, 0, 150, 53], [0, 53, 150, 59]],
    "columns": [[0, 0, 47, 112], [47, 0, 64, 112], [111, 0, 39, 112]],
    "grid": [[0, 0, 75, 56], [75, 0, 75, 56], [0, 56, 75, 56], [75, 56, 75, 56]],
    "mixed": [[0, 0, 150, 41], [0, 41, 61, 71], [61, 41, 89, 31], [61, 72, 89, 40]],
    "l": [[0, 0, 75, 56], [75, 0, 75, 56], [0, 56, 75, 56]],
}
FILTERS = {
    "denoised": ("--denoise",),
    "denoised at best": ("--denoise", "--quality", "best", "--photons", "20000"),
    "scaled by half": ("--resolution-scale", "0.5"),
    "scaled unevenly": ("--resolution-scale", "0.37"),
    "at half resolution": ("--half-resolution", "shadow"),
    "at half resolution in another sample": ("--half-resolution", "shadow", "--spp", "2"),
}
# How many times as large as about it a step at a seam may be. It was 2 to 5 times as large.
MOST = 1.45


def write_wall(path, screens, gap=0.0):
    """`gap` in pixels, between columns and rows."""
    columns = sorted({screen[0] for screen in screens})
    rows = sorted({screen[1] for screen in screens})
    text = "hpr_wall = 1\n[[viewers]]\nid = 'v'\nposition_m = [0.375, -0.28, 1.1]\n[[surfaces]]\nid = 's'\nscreens = [\n"
    for i, (x, y, width, height) in enumerate(screens):
        left, top = (x + gap * columns.index(x)) * PIXEL, -(y + gap * rows.index(y)) * PIXEL
        right, low = left + width * PIXEL, top - height * PIXEL
        text += (f"{{ id = 's{i}', pixels = [{width}, {height}], corners_m = {{ ll = [{left:.6f}, {low:.6f}, 0], "
                 f"lr = [{right:.6f}, {low:.6f}, 0], ul = [{left:.6f}, {top:.6f}, 0] }} }},\n")
    path.write_text(text + "]\n")


def draw(folder, wall, more, ranks=1):
    """The file of each screen."""
    shutil.rmtree(folder / "out", ignore_errors=True)
    samples = () if "--spp" in more else ("--spp", "1")
    result = run(folder, "wall", "run", f"{wall}.toml", SCENE, "--exposure", "0", "--tone", "none", "--ranks", str(ranks),
                 "--display", "file", "-o", "out", *samples, *more)
    expect(result.returncode == 0, f"{wall} {more}: left with {result.returncode}: {result.stderr[-1000:]}")
    return [path.read_bytes() for path in sorted((folder / "out").glob("s*.png"))]


def assembled(screens, files):
    """(width, height, pixels by place) of the wall without gaps."""
    pixels = {}
    for (x, y, width, height), data in zip(screens, files):
        shown = png.decode(data)
        expect(shown[:2] == (width, height), f"a screen of {shown[:2]} pixels in place of {width}x{height}")
        for row in range(height):
            for column in range(width):
                at = 4 * (row * width + column)
                pixels[x + column, y + row] = shown[2][at:at + 3]
    return pixels


def step_at(pixels, line, along, across):
    """The mean difference of the pixels before and after a line; `across` is the axis that it is crossed along."""
    def pixel(at, place):
        return pixels.get((at, place) if across == 0 else (place, at))
    steps = [sum(abs(a - b) for a, b in zip(before, after)) / 3 for before, after in
             ((pixel(line - 1, place), pixel(line, place)) for place in along) if before and after]
    return statistics.mean(steps) if steps else 0.0


def seams(screens):
    """(axis, line, range along it) of each edge that two screens share."""
    for x, y, width, height in screens:
        for other_x, other_y, other_width, other_height in screens:
            rows = range(max(y, other_y), min(y + height, other_y + other_height))
            if x + width == other_x and rows:
                yield 0, other_x, rows
            columns = range(max(x, other_x), min(x + width, other_x + other_width))
            if y + height == other_y and columns:
                yield 1, other_y, columns


def no_steps(folder):
    whole = {}
    for name, screens in WALLS.items():
        write_wall(folder / f"{name}.toml", screens)
    write_wall(folder / "one.toml", [[0, 0, 150, 112]])
    for filtered, more in FILTERS.items():
        whole[filtered] = assembled([[0, 0, 150, 112]], draw(folder, "one", more))
        for name, screens in WALLS.items():
            files = draw(folder, name, more)
            pixels = assembled(screens, files)
            for axis, line, along in seams(screens):
                step = step_at(pixels, line, along, axis)
                # Edges of the scene that lie there, but no 64 x 64 tile of the one screen.
                alone = step_at(whole[filtered], line, along, axis) if line % 64 else 0.0
                about = statistics.median(step_at(pixels, line + off, along, axis) for off in (-8, -6, -5, -4, -3, 3, 4, 5, 6, 8))
                expect(step <= MOST * max(about, alone) + 0.1, f"{name}, {filtered}: a step of {step:.2f} at {'xy'[axis]} = {line}, "
                       f"{about:.2f} about it, {alone:.2f} on one screen")
            if "scaled" in filtered and name != "l":
                expect(pixels == whole[filtered], f"{name}, {filtered}: other pixels than one screen has")


def tiles_have_no_seams(folder):
    """From 4 samples on filters go on from tile to tile of one screen too."""
    width, height = 200, 120
    write_wall(folder / "tiles.toml", [[0, 0, width, height]])
    for more in (("--denoise",), ("--half-resolution", "shadow,photon")):
        pixels = assembled([[0, 0, width, height]], draw(folder, "tiles", (*more, "--indirect", "--spp", "4")))
        for axis, line, along in ((0, 64, range(height)), (0, 128, range(height)), (1, 64, range(width))):
            step = step_at(pixels, line, along, axis)
            about = statistics.median(step_at(pixels, line + off, along, axis) for off in (-8, -6, -5, -4, -3, 3, 4, 5, 6, 8))
            expect(step <= MOST * about + 0.1, f"tiles, {more[0]}: a step of {step:.2f} at {'xy'[axis]} = {line}, {about:.2f} about it")


def same_bits(folder):
    for name, more in (("grid", FILTERS["denoised"]), ("rows", ("--denoise", "--spp", "4")), ("mixed", FILTERS["scaled unevenly"]), ("columns", FILTERS["at half resolution"])):
        expected = draw(folder, name, more)
        for ranks, spread in ((3, ()), (3, ("--distribute", "sort-last")), (2, ("--data", "partitioned")), (1, ("--threads", "1"))):
            expect(draw(folder, name, (*more, *spread), ranks) == expected, f"{name} {more}: other bits on {ranks} ranks {spread}")


def gaps_keep_screens_apart(folder):
    """Where there is a gap, a screen shows what it does beside no other."""
    screens = [[0, 0, 75, 56], [75, 0, 75, 56]]
    write_wall(folder / "gap.toml", screens, gap=1.0)
    write_wall(folder / "alone.toml", screens[:1])
    for filtered in ("denoised", "scaled by half", "at half resolution"):
        expect(draw(folder, "gap", FILTERS[filtered])[0] == draw(folder, "alone", FILTERS[filtered])[0],
               f"{filtered}: a screen beyond a gap is seen")
    for name in ("grid", "rows"):
        files = draw(folder, name, ())
        expect(len(files) == len(WALLS[name]), f"{name}: {len(files)} screens")


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        no_steps(folder)
        tiles_have_no_seams(folder)
        same_bits(folder)
        gaps_keep_screens_apart(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
