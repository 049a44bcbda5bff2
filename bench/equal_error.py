#!/usr/bin/env python3
"""The hybrid's and Mitsuba 3's time for pictures of equal error: a curve of relMSE over time for each, and their ratio.

usage: equal_error.py HPR [--scenes NAME,...] [--size N] [--ways NAME,...] [--rounds N] [--truth-spp N] [--particle-spp N]
                      [--trim PERCENT] [--sampler NAME] [--cache FOLDER] [--json FILE]

Times are of rendering alone: no loading, no compiling (Mitsuba renders each size once before it is timed). Each round takes
every picture of both renderers once, those of equal samples next to each other, and compares times of that round alone: a
machine that slows down slows down both. Ratios are medians of the rounds, the least and the greatest beside them. The truth is
Mitsuba's, of many samples: of its path tracer, but where all lights are small, caustics on matte surfaces are found by paths so
seldom that most of their light is missing from the mean and the rest is fireflies; there indirect light is that of its particle
tracer. relMSE is trimmed by the worst 0.1 % of pixels (--trim), which in Mitsuba's pictures are fireflies. What chance leaves in
the truth is taken off every error. Needs what tests/mitsuba_test.py needs, and says so when something is missing.
"""
import argparse
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests"))
import mitsuba_test as peer  # noqa: E402

SAMPLES_AT_ONCE = 64  # of Mitsuba: more of them need more memory, not less time
MITSUBA_SAMPLES = (1, 4, 16, 64, 256, 1024)
WAYS = {
    # name: (options, samples of a pixel)
    "draft": (["--quality", "draft"], (1, 2, 4, 8, 16, 32)),
    "good": (["--quality", "good"], (1, 4, 16, 64)),
    "best": (["--quality", "best"], (1, 4, 16, 64)),
    # What suits small pictures of many triangles: rays find the first surfaces too, fewer photons go out per sample.
    "tuned": (["--quality", "best", "--primary", "rays", "--photons", "16384"], (1, 4, 16, 64, 256)),
    "denoised": (["--quality", "best", "--primary", "rays", "--photons", "16384", "--denoise"], (1, 2, 4, 8, 16)),
    "adaptive": (["--quality", "best", "--primary", "rays", "--photons", "16384", "--adaptive"], (16, 64, 256)),
    "reference": (["--reference"], (1, 4, 16, 64)),
}


def relmse(numpy, picture, truth, trim):
    return peer.trimmed_mean(numpy, ((picture - truth) ** 2).mean(-1) * peer.relative_weight(truth), trim)


def render_mitsuba(numpy, mitsuba, scene, spp, seed):
    """A picture, and the seconds it took."""
    done, total, start = 0, 0.0, time.perf_counter()
    while done < spp:
        part = min(SAMPLES_AT_ONCE, spp - done)
        total = total + part * numpy.array(mitsuba.render(scene, spp=part, seed=seed * 100_000 + done)).astype(numpy.float64)
        done += part
    return total / spp, time.perf_counter() - start


def render_hpr(numpy, mitsuba, hpr, path, options, size, spp, seed, folder):
    picture, stats = folder / "picture.exr", folder / "stats.json"
    subprocess.run([hpr, "render", str(path), "-o", str(picture), "--force", "--stats", str(stats), "--size", f"{size}x{size}",
                    "--spp", str(spp), "--seed", str(seed), "--max-depth", str(peer.DEPTH), "--filter", "box",
                    "--no-terminator-fix", *options], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    pixels = numpy.array(mitsuba.Bitmap(str(picture)))[..., :3].astype(numpy.float64)
    return pixels, json.loads(stats.read_text())["ms"] / 1000.0


def seconds_at(errors, seconds, error):
    """When Mitsuba reaches the error: between its points and beyond them as noise falls, 1 / time."""
    points = sorted(zip(errors, seconds), reverse=True)
    if error >= points[0][0]:
        return points[0][1]
    for (error_before, before), (error_after, after) in zip(points, points[1:]):
        if error >= error_after:
            part = math.log(error_before / error) / math.log(error_before / error_after)
            return before * (after / before) ** part
    return points[-1][1] * points[-1][0] / error


def take_rounds(renderers, rounds, error):
    """Pictures of all renderers, taken in turn: {(name, samples): {"relmse": mean, "seconds": [of each round]}}.

    renderers: {name: (samples of a pixel, render(spp, seed) -> (picture, seconds))}."""
    turns = sorted(((spp, name) for name, (samples, _) in renderers.items() for spp in samples), key=lambda turn: turn[0])
    found = {(name, spp): {"relmse": 0.0, "seconds": []} for spp, name in turns}
    for number in range(1, rounds + 1):
        for spp, name in turns:
            if sys.stderr.isatty():
                print(f"\rround {number} of {rounds}: {name}, {spp} spp      ", end="", file=sys.stderr, flush=True)
            picture, seconds = renderers[name][1](spp, number)
            found[name, spp]["relmse"] += error(picture) / rounds
            found[name, spp]["seconds"].append(seconds)
    if sys.stderr.isatty():
        print("\r" + 60 * " " + "\r", end="", file=sys.stderr, flush=True)
    return found


def curves_of(renderers, found):
    """For each renderer its points by samples: relMSE, median seconds and, but for Mitsuba, how many times faster than it."""
    errors = [found["mitsuba", spp]["relmse"] for spp in MITSUBA_SAMPLES]
    curves = {}
    for name, (samples, _) in renderers.items():
        curves[name] = []
        for spp in samples:
            relmse, seconds = found[name, spp]["relmse"], found[name, spp]["seconds"]
            point = {"spp": spp, "relmse": relmse, "seconds": statistics.median(seconds)}
            if name != "mitsuba":
                peers = zip(*(found["mitsuba", peer_spp]["seconds"] for peer_spp in MITSUBA_SAMPLES))
                ratios = [seconds_at(errors, of_round, relmse) / own for of_round, own in zip(peers, seconds)]
                point |= {"times_faster": statistics.median(ratios), "least": min(ratios), "greatest": max(ratios)}
            curves[name].append(point)
    return curves


def print_curves(curves):
    for name, points in curves.items():
        for point in points:
            line = f"  {name:10} {point['spp']:5d} spp {point['seconds']:8.3f} s  relMSE {point['relmse']:.3g}"
            if "times_faster" in point:
                line += f"  {point['times_faster']:.2f} x faster ({point['least']:.2f} to {point['greatest']:.2f})"
            print(line, flush=True)


def mean_of(numpy, mitsuba, scene, integrators, spp, seed):
    """The first integrator's picture less the others', with the same random numbers."""
    loaded = [mitsuba.load_dict(integrator) for integrator in integrators]
    total, parts = 0.0, max(1, spp // SAMPLES_AT_ONCE)
    for part in range(parts):
        pictures = [numpy.array(mitsuba.render(scene, integrator=integrator, spp=SAMPLES_AT_ONCE, seed=seed * 100_000 + part))
                    .astype(numpy.float64)[..., :3] for integrator in loaded]
        total = total + pictures[0] - sum(pictures[1:])
    return total / parts


def matte_pixels(numpy, mitsuba, description):
    """Where all that is seen is matte: [height][width]. Seen where only matte shapes glow."""
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    glowing = {}
    for key, value in description.items():
        if not key.startswith("light_"):
            glowing[key] = value
        if key.startswith("shape_"):
            bsdf = value["bsdf"].get("bsdf", value["bsdf"])
            glowing[key] = value | {"bsdf": black}
            if bsdf.get("roughness", {}).get("value", 0.0) >= 0.9:
                glowing[key]["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
    scene = mitsuba.load_dict(glowing | {"integrator": {"type": "path", "max_depth": 1}})
    # Lamps shine to the front alone; faces that are seen from behind are not matte here, and get their truth by paths.
    return numpy.array(mitsuba.render(scene, spp=SAMPLES_AT_ONCE)).min(-1) == 1.0


def particles_truth(numpy, mitsuba, scene, options, seed):
    """Direct light, which no chance is left in but that of the pixel's area, and indirect light that starts at the lights: of
    both, the particle tracer's share of direct light is taken off with the very particles."""
    direct = mean_of(numpy, mitsuba, scene, [{"type": "path", "max_depth": 2}], options.truth_spp // 8, seed)
    particles = [{"type": "ptracer", "max_depth": depth, "rr_depth": 100} for depth in (peer.DEPTH, 2)]
    return direct + mean_of(numpy, mitsuba, scene, particles, options.particle_spp // 2, seed)


def truth_of(numpy, mitsuba, scene, description, name, options):
    """The mean of many samples, and what chance leaves of its relMSE."""
    ambient = peer.SCENES[name][1]
    samples = f"{options.truth_spp}" if ambient else f"{options.truth_spp}+{options.particle_spp}"
    stored = options.cache and pathlib.Path(options.cache) / f"{name}-{options.size}-{samples}.npz"
    if stored and stored.exists():
        halves = list(numpy.load(stored)["halves"])
    else:
        halves = [render_mitsuba(numpy, mitsuba, scene, options.truth_spp // 2, seed)[0] for seed in (101, 102)]
        if not ambient and options.particle_spp > 0:
            matte = matte_pixels(numpy, mitsuba, description)[..., None]
            halves = [numpy.where(matte, particles_truth(numpy, mitsuba, scene, options, seed), half)
                      for seed, half in zip((103, 104), halves)]
    if stored:
        stored.parent.mkdir(parents=True, exist_ok=True)
        numpy.savez(stored, halves=halves)
    return sum(halves) / 2.0, relmse(numpy, halves[0], halves[1], options.trim) / 4.0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--scenes", default="pbr-spheres,two-monkeys")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--truth-spp", type=int, default=8192)
    parser.add_argument("--particle-spp", type=int, default=131072, help="of the particle tracer, where lights are small; 0: none")
    parser.add_argument("--trim", type=float, default=0.1, help="percent of the pixels, the worst, that do not count")
    parser.add_argument("--sampler", default="independent", help="Mitsuba's; multijitter and others spread samples evenly")
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--cache", help="a folder for the truths, which take minutes")
    parser.add_argument("--json", help="a file for all figures")
    options = parser.parse_args()
    scenes = pathlib.Path(os.environ.get("HPR_SCENES", "scenes")).resolve()
    mitsuba, numpy, gltf2mi = peer.load_mitsuba(scenes.parent / "tools")
    report = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        for name in options.scenes.split(","):
            file, ambient = peer.SCENES[name]
            description, notes = peer.to_mitsuba(gltf2mi, mitsuba, numpy, name, scenes / file, folder, options.size, options.sampler)
            scene = mitsuba.load_dict(description)
            truth, noise = truth_of(numpy, mitsuba, scene, description, name, options)

            def error(picture, truth=truth, noise=noise):
                return max(relmse(numpy, picture, truth, options.trim) - noise, 0.1 * noise)

            light = ["--environment", f"{ambient},{ambient},{ambient}"] if ambient else []
            common = [*light, *peer.camera_options(notes)]

            def render_peer(spp, seed, scene=scene):
                return render_mitsuba(numpy, mitsuba, scene, spp, seed)

            renderers = {"mitsuba": (MITSUBA_SAMPLES, render_peer)}
            for way in options.ways.split(","):
                settings, samples = WAYS[way]

                def render_way(spp, seed, path=scenes / file, settings=(*settings, *common)):
                    return render_hpr(numpy, mitsuba, options.hpr, path, settings, options.size, spp, seed, folder)

                renderers[way] = (samples, render_way)
            for spp in MITSUBA_SAMPLES:
                render_mitsuba(numpy, mitsuba, scene, min(spp, SAMPLES_AT_ONCE), 99)
            curves = curves_of(renderers, take_rounds(renderers, options.rounds, error))
            report[name] = {"truth_noise": noise, **curves}
            print(f"{name}: the truth's own relMSE is about {noise:.2g}")
            print_curves(curves)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(report, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
