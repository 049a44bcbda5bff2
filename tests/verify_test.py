#!/usr/bin/env python3
"""--verify draws tiles again on other ranks and finds the same bits: counted, and no bit of a picture changes.

usage: verify_test.py HPR

What happens where bits differ is in engine/verification_test.cpp. Prints what was wrong and leaves with 1.
"""

import json
import pathlib
import sys
import tempfile

from program import expect, failures, run

TILES = 12  # of 200x150 pixels
PICTURE = ["--size", "200x150", "--force"]


def pictures(folder):
    """The same bits with and without, and every tile of every sample was drawn twice."""
    for name, ranks, samples, options in (("plain", 1, 4, []), ("first", 3, 4, []),
                                          ("last", 2, 1, ["--distribute", "sort-last"]),
                                          ("middle", 3, 2, ["--distribute", "sort-middle", "--primary", "raster"]),
                                          ("rays", 3, 4, ["--distribute", "sort-last", "--primary", "rays"]),
                                          ("adaptive", 2, 32, ["--adaptive", "--primary", "rays"])):
        bits = []
        for percent in ("0", "100"):
            result = run(folder, "render", "gen:cornell", *PICTURE, *options, "--ranks", str(ranks), "--spp",
                         str(samples), "--verify", percent, "-o", "p.exr", "--stats", "s.json")
            expect(result.returncode == 0 and "otherwise" not in result.stderr, f"{name}: {result.stderr[-500:]}")
            bits.append((folder / "p.exr").read_bytes())
        expect(bits[0] == bits[1], f"{name}: --verify changes the picture")
        verify = json.loads((folder / "s.json").read_text()).get("verify", {})
        expect(verify.get("percent") == 100 and verify.get("mismatches") == 0, f"{name}: {verify}")
        # Adaptive sampling has rounds in which some pixels get no sample.
        wanted, counted = TILES * samples, verify.get("tiles", 0)
        expect(counted == wanted or name == "adaptive" and counted > wanted, f"{name}: {counted} tiles, not {wanted}")
    run(folder, "render", "gen:cornell", *PICTURE, "--stats", "off.json")
    expect("verify" not in json.loads((folder / "off.json").read_text()), "stats count what was not asked for")


def walls(folder):
    """Every frame of a manifest has its counts, of other tiles each time."""
    frames = 30
    result = run(folder, "wall", "run", "2x1@128x128", "gen:cornell", "--frames", str(frames),
                 "--verify", "25", "--ranks", "2", "--display", "file", "-o", "wall", "--quality", "draft")
    expect(result.returncode == 0, result.stderr[-500:])
    counts = [frame["verify"] for frame in json.loads((folder / "wall/manifest.json").read_text())["frames"]]
    tiles = [count["tiles"] for count in counts]
    expect(len(counts) == frames and all(count["mismatches"] == 0 for count in counts), f"{counts}")
    # 8 tiles a frame, a quarter of them: 60 in all, give or take four standard deviations.
    expect(abs(sum(tiles) - 60) < 27 and len(set(tiles)) > 1, f"tiles of each frame: {tiles}")


def refused(folder):
    for options in (["--verify", "101"], ["--verify", "-1"], ["--verify", "1", "--shading", "local"],
                    ["--verify", "1", "--data", "partitioned"], ["--verify", "1", "--deterministic", "off"]):
        result = run(folder, "render", "gen:cornell", *PICTURE, "-o", "r.png", *options)
        expect(result.returncode == 2 and "--verify" in result.stderr, f"{options}: {result.returncode} {result.stderr}")
    result = run(folder, "render", "gen:cornell", "--explain", "--verify", "5")
    expect("verify: 5 % of the tiles" in result.stdout, result.stdout)


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-verify-") as scratch:
        folder = pathlib.Path(scratch)
        pictures(folder)
        walls(folder)
        refused(folder)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
