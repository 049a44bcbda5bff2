#!/usr/bin/env python3
"""What the pipe display sends is what the file display writes: raw to the bit, as Y4M within its rounding.

usage: pipe_display_test.py HPR

Prints what differs and leaves with 1.
"""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

import png
import processes

HPR = os.path.abspath(sys.argv[1])
WALL = "2x1@80x48"
RUN = ["wall", "run", WALL, "gen:gallery", "--path", "path.txt"]
PATH = "eye -3,1.7,4 at 0,1.6,-2\neye 3,1.7,4 at 0,1.6,-2\n"
LIMITS = (1, 1, 2)  # levels of red, green and blue, see docs/walls.md
failures = []


def complain(message):
    failures.append(message)
    print(message)


def hpr(folder, *arguments, code=0, frames=2):
    result = subprocess.run([HPR, *RUN, "--frames", str(frames), *arguments], cwd=folder, capture_output=True, timeout=120,
                            check=False)
    if result.returncode != code:
        complain(f"{' '.join(arguments)}: left with {result.returncode} instead of {code}:\n{result.stderr.decode()[-900:]}")
    return result


def planes_of(stream):
    """[(width, height, Y, Cb, Cr)] of a Y4M stream."""
    header, rest = stream.split(b"\n", 1)
    words = header.decode().split(" ")
    if words[0] != "YUV4MPEG2" or "C444" not in words or "F30:1" not in words or "XCOLORRANGE=LIMITED" not in words:
        complain(f"header {header!r}")
    width = int(next(w for w in words if w[0] == "W")[1:])
    height = int(next(w for w in words if w[0] == "H")[1:])
    frames = []
    while rest:
        if not rest.startswith(b"FRAME\n") or len(rest) < 6 + 3 * width * height:
            complain(f"frame {len(frames)} of the stream is broken")
            break
        planes = [rest[6 + i * width * height:6 + (i + 1) * width * height] for i in range(3)]
        frames.append((width, height, *planes))
        rest = rest[6 + 3 * width * height:]
    return frames


def colors_of(planes):
    """Red, green, blue of each pixel, by the inverse of BT.709's matrix."""
    for y, cb, cr in zip(*planes):
        luma = 255 * (y - 16) / 219
        red = luma + 1.5748 * 255 * (cr - 128) / 224
        blue = luma + 1.8556 * 255 * (cb - 128) / 224
        green = (luma - 0.2126 * red - 0.0722 * blue) / 0.7152
        yield round(red), round(green), round(blue)


def compare(name, frame, picture):
    width, height, rgba = picture
    if frame[:2] != (width, height):
        complain(f"{name}: {frame[:2]} instead of {(width, height)}")
        return
    worst = [0, 0, 0]
    for i, color in enumerate(colors_of(frame[2:])):
        for channel in range(3):
            worst[channel] = max(worst[channel], abs(color[channel] - rgba[4 * i + channel]))
    if any(found > limit for found, limit in zip(worst, LIMITS)):
        complain(f"{name}: off by {worst} levels, more than {LIMITS}")
    if len(set(rgba[0::4])) < 5:
        complain(f"{name}: the picture it is compared with shows next to nothing")


def through_a_fifo(folder):
    os.mkfifo(folder / "fifo")
    got = []
    reader = threading.Thread(target=lambda: got.append((folder / "fifo").read_bytes()))
    reader.start()
    hpr(folder, "--display", "pipe", "-o", "fifo", "--pipe-format", "rgba")
    reader.join(timeout=30)
    return got[0] if got else b""


def lose_a_rank(folder):
    """What a reader was given cannot be taken back: a job that is lost is not started again."""
    run = subprocess.Popen([HPR, *RUN, "--frames", "100000", "--display", "pipe", "--pipe-to", "cat > lost.y4m", "--ranks", "2"],
                           cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    lost = folder / "lost.y4m"
    end = time.monotonic() + 60
    while time.monotonic() < end and not (lost.exists() and lost.stat().st_size > 0):
        time.sleep(0.1)
    ranks = processes.ranks_of(run.pid)
    if len(ranks) == 2:
        os.kill(ranks[1], signal.SIGKILL)
    try:
        said = run.communicate(timeout=60)[1]
    except subprocess.TimeoutExpired:
        run.kill()
        said = run.communicate()[1]
    if len(ranks) != 2 or run.returncode != 7 or "starting it again" in said:
        complain(f"a rank of {len(ranks)} was killed: left with {run.returncode}: {said[-900:]}")
    lost.unlink(missing_ok=True)


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-pipe-") as scratch:
        folder = pathlib.Path(scratch)
        (folder / "path.txt").write_text(PATH)
        hpr(folder, "--display", "file", "-o", "files", "--keep-frames")
        screens = sorted(p.stem for p in (folder / "files" / "frame-000000").glob("*.png"))
        kept = [[png.read(folder / "files" / f"frame-00000{i}" / f"{s}.png") for s in screens] for i in (0, 1)]
        if len(screens) != 2 or kept[0] == kept[1]:
            complain(f"kept frames of {screens}, equal: {kept[0] == kept[1]}")

        raw = hpr(folder, "--display", "pipe", "-o", "-", "--pipe-format", "rgba", "--pipe-screen", screens[1]).stdout
        if raw != kept[0][1][2] + kept[1][1][2]:
            complain(f"raw frames on stdout: {len(raw)} bytes, not those of {screens[1]}")

        hpr(folder, "--display", "pipe", "--pipe-to", "cat > wall.y4m", "--ranks", "2")
        frames = planes_of((folder / "wall.y4m").read_bytes())
        if len(frames) != 2:
            complain(f"{len(frames)} frames instead of 2")
        else:
            compare("the last frame of the wall", frames[1], png.read(folder / "files" / "wall.png"))

        hpr(folder, "--display", "pipe", "-o", "screen.y4m", "--pipe-screen", screens[0])
        frames = planes_of((folder / "screen.y4m").read_bytes())
        if len(frames) != 2:
            complain(f"{len(frames)} frames of {screens[0]} instead of 2")
        for i, frame in enumerate(frames):
            compare(f"frame {i} of {screens[0]}", frame, kept[i][0])
        hpr(folder, "--display", "pipe", "-o", "screen.y4m", code=4)  # it exists

        hpr(folder, "--display", "file", "-o", "first", frames=1)
        walls = b"".join(png.read(folder / name / "wall.png")[2] for name in ("first", "files"))
        fifo = through_a_fifo(folder)
        if fifo != walls:
            complain(f"{len(fifo)} bytes through the FIFO, not the {len(walls)} of the wall's two frames")
        lose_a_rank(folder)

        stuck = hpr(folder, "--display", "pipe", "--pipe-to", "sleep 100", "--pipe-timeout", "300ms",
                    "--pipe-format", "rgba", code=4, frames=40)
        if b"read nothing for 0.3 s" not in stuck.stderr:
            complain(f"a reader that stands still: {stuck.stderr.decode()!r}")
        hpr(folder, "--display", "pipe", "--pipe-to", "exit 1", code=4)
        hpr(folder, "--display", "pipe", code=2)
        hpr(folder, "--display", "pipe", "-o", "-", "--explain", code=2)
        left = {p.name for p in folder.iterdir()} - {"path.txt", "files", "first", "wall.y4m", "screen.y4m", "fifo"}
        if left:
            complain(f"left files: {left}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
