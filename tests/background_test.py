#!/usr/bin/env python3
"""What --background shows past all surfaces, and the alpha of pictures without one: coverage computed by hand, the same
bits whatever the ranks, and kept by everything a sample goes through.

usage: background_test.py HPR

Prints what is wrong and leaves with 1.
"""

import math
import pathlib
import signal
import subprocess
import sys
import tempfile

import exr
import png
from program import HPR, expect, failures
from quads import Quads

SIDE = 8
# The quad's edges, a metre from the middle, lie two and a half of four pixels from it, so that columns and rows 1 and 6
# are covered by half, what is between them is covered, and the rest is not.
FOV_DEGREES = 2.0 * math.degrees(math.atan(1.6 / 5.0))
CAMERA = (f"--size={SIDE}x{SIDE}", "--eye=0,0,5", "--at=0,0,0", f"--fov={FOV_DEGREES:.12f}")
ORANGE = (1.0, 0.5, 0.125)
HALF = (1, 6)
PLAIN = ("--tone=none", "--exposure=0", "--environment=none", "--denoise=false")


def hpr(folder, *arguments, code=0):
    result = subprocess.run([HPR, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=100, check=False)
    expect(result.returncode == code, f"hpr {' '.join(map(str, arguments))} left with {result.returncode}: {result.stderr[-1000:]}")
    return result


def options(arguments):
    """The arguments, and of the usual ones those that they do not name."""
    named = {str(argument).split("=")[0] for argument in arguments}
    return [*(usual for usual in (*CAMERA, *PLAIN) if usual.split("=")[0] not in named), *map(str, arguments)]


def render(folder, scene, *arguments, picture="a.exr"):
    return hpr(folder, "render", scene, "-o", picture, "--force", *options(arguments))


def render_exr(folder, scene, *arguments):
    render(folder, scene, *arguments)
    return exr.read(folder / "a.exr")[2]


def render_png(folder, scene, *arguments):
    render(folder, scene, *arguments, picture="a.png")
    return pixels_of(folder / "a.png")


def pixels_of(path):
    width, _, values = png.read(path)
    pixels = [tuple(values[i:i + 4]) for i in range(0, len(values), 4)]
    return [pixels[i:i + width] for i in range(0, len(pixels), width)]


def share(i):
    return 0.5 if i in HALF else 1.0 if HALF[0] < i < HALF[1] else 0.0


def covered(x, y):
    return share(x) * share(y)


def write_scenes(folder):
    quads = Quads()
    quads.place(quads.mesh(quads.material((*ORANGE, 1.0))))
    quads.write(folder / "quad.gltf")
    veils = Quads()
    veil = {"alphaMode": "BLEND"}
    veils.place(veils.mesh(veils.material((0.0, 1.0, 0.0, 0.25), **veil)), translation=[0, 0, 1], scale=[10, 10, 1])
    veils.place(veils.mesh(veils.material((1.0, 0.0, 0.0, 0.5), **veil)), scale=[10, 10, 1])
    veils.write(folder / "veils.gltf")
    mask = Quads()
    mask.place(mask.mesh(mask.material((*ORANGE, 0.25), alphaMode="MASK")))
    mask.write(folder / "hole.gltf")
    mirror = Quads()
    metal = {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 1, "roughnessFactor": 0}
    mirror.place(mirror.mesh(mirror.material((1, 1, 1, 1), pbrMetallicRoughness=metal)))
    mirror.write(folder / "mirror.gltf")


def check_coverage(case, layers, expected, tolerance, color=ORANGE):
    """Alpha as expected, exactly where all or nothing is covered, and colors multiplied by it."""
    expect("A" in layers, f"{case}: no alpha")
    for i, alpha in enumerate(layers.get("A", [])):
        wanted = expected(i % SIDE, i // SIDE)
        exact = wanted in (0.0, 1.0)
        expect(alpha == wanted if exact else abs(alpha - wanted) <= tolerance,
               f"{case}: pixel {i % SIDE},{i // SIDE} has alpha {alpha}, not {wanted}")
        for letter, part in zip("RGB", color):
            expect(abs(layers[letter][i] - alpha * part) <= 2e-6,
                   f"{case}: pixel {i % SIDE},{i // SIDE} has {letter} {layers[letter][i]} at alpha {alpha}")


def what_samples_go_through(folder):
    """All the ways from a sample to a picture, of a quad that covers some pixels by half."""
    transparent = ("--background", "transparent")
    for case, arguments, tolerance in [
            ("256 samples", ("--spp", 256), 1 / 256),
            ("a filter", ("--spp", 1024, "--filter", "box", "--primary", "rays"), 1 / 512),
            ("adaptive", ("--spp", 256, "--adaptive"), 1 / 128),
            ("denoised", ("--spp", 1, "--denoise=true"), 0.05),
            ("denoised, many samples", ("--spp", 64, "--denoise=true"), 0.02),
            ("half resolution", ("--spp", 256, "--half-resolution", "shadow"), 1 / 256),
            ("the reference", ("--spp", 256, "--reference"), 1 / 256),
            ("sort-last", ("--spp", 256, "--ranks", 2, "--distribute", "sort-last"), 1 / 256),
            ("partitioned", ("--spp", 256, "--ranks", 2, "--data", "partitioned", "--denoise=true"), 1 / 64),
            ("verified", ("--spp", 256, "--ranks", 2, "--verify", 100), 1 / 256)]:
        check_coverage(case, render_exr(folder, "quad.gltf", *transparent, *arguments), covered, tolerance)
    # Two bits of color are lost.
    local = render_exr(folder, "quad.gltf", *transparent, "--spp", 256, "--shading", "local")
    for i, alpha in enumerate(local["A"]):
        expect(abs(alpha - covered(i % SIDE, i // SIDE)) <= 1 / 256, f"local shading: alpha {alpha}")
    # A filter that overshoots still covers between nothing and all.
    wide = render_exr(folder, "quad.gltf", *transparent, "--spp", 256, "--filter", "mitchell")
    expect(all(0.0 <= alpha <= 1.0 for alpha in wide["A"]) and max(wide["A"]) == 1.0, "mitchell: alpha leaves 0 to 1")
    # Of four pixels a side the outer ones are covered by a quarter; new ones lie at a quarter of their distance.
    enlarged = (0.25, 0.4375, 0.8125, 1.0, 1.0, 0.8125, 0.4375, 0.25)
    small = render_exr(folder, "quad.gltf", *transparent, "--spp", 256, "--resolution-scale", 0.5)
    for i, alpha in enumerate(small["A"]):
        expect(abs(alpha - enlarged[i % SIDE] * enlarged[i // SIDE]) <= 0.01, f"resolution: pixel {i} has alpha {alpha}")
        expect(abs(small["R"][i] - alpha) <= 2e-6, f"resolution: pixel {i} has red {small['R'][i]} at alpha {alpha}")
    render(folder, "quad.gltf", *transparent, "--spp", 256, "--resolution-scale", 0.5, picture="a.png")
    expect(pixels_of(folder / "a.png")[0][0] == (255, 188, 99, 16), f"resolution: {pixels_of(folder / 'a.png')[0][0]}")


def surfaces_that_cover_in_part(folder):
    alpha = 1.0 - 0.75 * 0.5
    layers = render_exr(folder, "veils.gltf", "--background", "transparent", "--spp", 4)
    for i in range(SIDE * SIDE):
        seen = [layers[letter][i] for letter in "RGBA"]
        wanted = [0.75 * 0.5, 0.25, 0.0, alpha]
        expect(all(abs(a - b) < 1e-6 for a, b in zip(seen, wanted)), f"veils: pixel {i} is {seen}, not {wanted}")
    reference = render_exr(folder, "veils.gltf", "--background", "transparent", "--spp", 1024, "--reference")
    mean = sum(reference["A"]) / len(reference["A"])
    expect(abs(mean - alpha) < 4.0 * math.sqrt(alpha * (1 - alpha) / (1024 * SIDE * SIDE)), f"veils: the reference has {mean}")
    hole = render_exr(folder, "hole.gltf", "--background", "transparent")
    expect(not any(hole["A"]) and not any(hole["R"]), "hole: what a mask leaves out covers")
    pixels = render_png(folder, "veils.gltf", "--background", "transparent")
    # 0.375 red and 0.25 green, divided by 0.625.
    expect(all(pixel == (203, 170, 0, 159) for row in pixels for pixel in row), f"veils: the PNG shows {pixels[0][0]}")


def other_backgrounds(folder):
    before = render_exr(folder, "quad.gltf")
    expect(render_exr(folder, "quad.gltf", "--background", "environment") == before, "environment is not the default")
    expect("A" not in before, "an alpha that nobody asked for")
    expect(all(pixel[3] == 255 for row in render_png(folder, "quad.gltf") for pixel in row), "a PNG that is transparent")
    blue = (0.0, 0.25, 2.0)
    layers = render_exr(folder, "quad.gltf", "--background", "0,0.25,2", "--spp", 256)
    expect("A" not in layers, "a color is transparent")
    for i in range(SIDE * SIDE):
        alpha = covered(i % SIDE, i // SIDE)
        for letter, front, back in zip("RGB", ORANGE, blue):
            expect(abs(layers[letter][i] - (alpha * front + (1 - alpha) * back)) < 0.01, f"color: pixel {i}, {letter}")
    veils = render_exr(folder, "veils.gltf", "--background", "0,0.25,2")
    expect(abs(veils["B"][0] - 0.375 * 2.0) < 1e-6, f"veils: the color behind is {veils['B'][0]}")
    for more in ((), ("--reference",), ("--denoise=true",)):
        lit = ("--environment", "2,3,4", *more)
        for background, past in (("0,1,0", (0, 1, 0)), ("transparent", (0, 0, 0)), ("environment", (2, 3, 4))):
            layers = render_exr(folder, "mirror.gltf", *lit, "--background", background)
            middle = (SIDE // 2) * SIDE + SIDE // 2
            seen = [tuple(layers[letter][i] for letter in "RGB") for i in (middle, 0)]
            expect(all(abs(a - b) < 1e-3 for a, b in zip(seen[0], (2, 3, 4))), f"{background} {more}: the mirror shows {seen[0]}")
            expect(seen[1] == past, f"{background} {more}: past the mirror is {seen[1]}")
    layers = render_exr(folder, "quad.gltf", "--aov", "coverage", "--spp", 256)
    expect("A" not in layers and abs(layers["coverage.X"][SIDE * 4 + 1] - 0.5) < 0.01, "--aov coverage")


def display_colors(folder):
    for tone in ("none", "neutral", "agx"):
        pixels = render_png(folder, "quad.gltf", "--background", "transparent", "--spp", 256, "--tone", tone)
        full = pixels[4][4]
        expect(full[3] == 255 and pixels[0][0] == (0, 0, 0, 0), f"{tone}: {full}, {pixels[0][0]}")
        expect(pixels[4][1][:3] == full[:3] and 126 <= pixels[4][1][3] <= 129, f"{tone}: {pixels[4][1]} beside {full}")
    small = render(folder, "quad.gltf", "--background", "transparent", "--fov=100", "--size=64x64", picture="a.png")
    expect("of the picture is black" not in small.stderr, f"nothing is black: {small.stderr}")
    # Nothing behind a bright quad makes it dark, nor changes its exposure.
    exposures = []
    for eye in ("0,0,5", "0,0,20"):
        render(folder, "quad.gltf", "--background", "transparent", "--eye", eye, "--exposure", "auto", picture="a.png")
        exposures.append(pixels_of(folder / "a.png")[4][4][:3])
    expect(exposures[0] == exposures[1], f"the exposure of a small thing is another one: {exposures}")


def ranks_and_checkpoints(folder):
    arguments = ("--background", "transparent", "--size", "150x70", "--spp", 4)
    pictures = {}
    for ranks in (("--ranks", 1), ("--ranks", 3), ("--ranks", 3, "--distribute", "sort-last"), ("--threads", 2)):
        for picture in ("a.exr", "a.png"):
            render(folder, "veils.gltf", *arguments, *ranks, picture=picture)
            made = (folder / picture).read_bytes()
            expect(pictures.setdefault(picture, made) == made, f"{picture}: other bits with {ranks}")
    whole = ("--background", "transparent", "--size", "64x64", "--spp", 3000, "--adaptive", "--progress", "line")
    render(folder, "quad.gltf", *whole, picture="whole.exr")
    command = [HPR, "render", "quad.gltf", "-o", "parts.exr", "--force", *options(whole)]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if line.startswith("hpr: sample "):
            process.send_signal(signal.SIGUSR1)
            break
    process.communicate(timeout=100)
    expect(process.returncode == 75, f"the run that was to stop left with {process.returncode}")
    render(folder, "quad.gltf", *whole, "--resume", picture="parts.exr")
    expect((folder / "parts.exr").read_bytes() == (folder / "whole.exr").read_bytes(), "resumed: other bits")


def walls(folder):
    wall = ("wall", "run", "2x1@32x32", "quad.gltf", "--background", "transparent", "--display", "file", "-o", "wall",
            "--frames", 1, "--force", *PLAIN)
    hpr(folder, *wall)
    alphas = {pixel[3] for path in sorted((folder / "wall").glob("*.png")) if path.name != "wall.png"
              for row in pixels_of(path) for pixel in row}
    expect(alphas == {0, 255}, f"screens have alphas {alphas}")
    hpr(folder, *wall[:4], "--display", "pipe", "--pipe-format", "rgba", "-o", "frames", *wall[4:6], "--frames", 1, "--force",
        *PLAIN)
    alphas = set((folder / "frames").read_bytes()[3::4])
    expect(alphas == {0, 255}, f"the pipe has alphas {alphas}")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-background-") as scratch:
        folder = pathlib.Path(scratch)
        write_scenes(folder)
        what_samples_go_through(folder)
        surfaces_that_cover_in_part(folder)
        other_backgrounds(folder)
        display_colors(folder)
        ranks_and_checkpoints(folder)
        walls(folder)
        for wrong in ("blue", "1,2", "-1,0,0", "nan,0,0"):
            hpr(folder, "render", "quad.gltf", "-o", "a.png", "--force", f"--background={wrong}", code=2)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
