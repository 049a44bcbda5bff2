#!/usr/bin/env python3
"""What the knobs cost and lose over six scenes: the evidence for --quality's words, as Markdown tables.

usage: fronts.py HPR [--scenes NAME,...] [--size WxH] [--reference-spp N] [--truths FOLDER] [--frames N] [--json FILE]

Each scene is swept knob by knob about a middle setting (--quality good --spp 4) by `hpr tradeoff`. Truths are what `--reference auto`
renders, or FOLDER/NAME.exr. Scenes that are files are looked for in $HPR_SCENES and left out where they are not.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys

SCENES = {
    # name: (scene, options)
    "cornell": ("gen:cornell", []),
    "gallery": ("gen:gallery?cases=4", []),
    "two-monkeys": ("two-monkeys/two-monkeys.glb", ["--exposure", "-2"]),
    "apartment": ("apartment/dream-apartment-plain.glb",
                  ["--environment", "1,1,1", "--eye", "6.6,9,-1.5", "--at", "6.6,0.5,-6.2", "--fov", "50"]),
    "pbr-spheres": ("pbr-spheres/PBR_Spheres.glb",
                    ["--environment", "1,1,1", "--eye", "0.9271677938983088,0.6954054739237316,1.5452796501971815",
                     "--at", "0,0.0000296,0", "--fov", "30"]),
    "asteroids": ("gen:asteroids?count=4000", []),
}
MIDDLE = ["--quality", "good", "--spp", "4"]
SWEEPS = {
    # title: (base options, knobs)
    "quality and spp": ([], ["quality=draft,good,best", "spp=1,4,16"]),
    "indirect light and photons": (MIDDLE, ["indirect=false,true", "photons=2000,10000,43200"]),
    "max-depth": (MIDDLE, ["max-depth=1,2,4,8,16"]),
    "glossy-cutoff": (MIDDLE, ["glossy-cutoff=0,0.1,0.3,0.6,1"]),
    "light-samples": (MIDDLE, ["light-samples=1,2,4"]),
    "resolution-scale": (MIDDLE, ["resolution-scale=0.25,0.5,0.75,1"]),
    "path tracing": ([], ["reference=true", "spp=4,16,64"]),
}
METRICS = ["flip", "relmse", "psnr", "ssim"]


def sweep(options, scene, extra, base, knobs, truth):
    command = [options.hpr, "tradeoff", scene, "--size", options.size, "--frames", str(options.frames), "--json", "--metric",
               ",".join(METRICS), *extra, *base]
    for knob in knobs:
        command += ["--vary", knob]
    command += ["--reference", truth] if truth else ["--reference-spp", str(options.reference_spp)]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def row(point, mean):
    error = point["error"]
    knobs = ", ".join(f"{knob} {value}" for knob, value in point["knobs"].items())
    psnr = "-" if error["psnr"] is None else f"{error['psnr']:.1f}"
    return (f"| {knobs} | {point['ms']['median']:.0f} | {error['flip']:.4f} | {error['relmse']:.3g} | {psnr} | "
            f"{error['ssim']:.3f} | {100 * error['mean'] / mean:+.2f} +- {100 * error['mean_error'] / mean:.2f} % | {'*' if point['pareto'] else ''} |")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("hpr")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--size", default="240x180")
    parser.add_argument("--reference-spp", type=int, default=512)
    parser.add_argument("--truths", type=pathlib.Path)
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--sweeps", default=",".join(SWEEPS))
    parser.add_argument("--json", type=pathlib.Path, help="a file for all reports")
    options = parser.parse_args()
    folder = pathlib.Path(os.environ.get("HPR_SCENES", "scenes"))
    reports = {}
    for name in options.scenes.split(","):
        scene, extra = SCENES[name]
        if not scene.startswith("gen:"):
            scene = str(folder / scene)
            if not pathlib.Path(scene).exists():
                print(f"{name}: left out, there is no {scene}", file=sys.stderr)
                continue
        truth = str(options.truths / f"{name}.exr") if options.truths else None
        reports[name] = {}
        print(f"\n### {name}")
        for title in options.sweeps.split(","):
            base, knobs = SWEEPS[title]
            report = sweep(options, scene, extra, base, knobs, truth)
            reports[name][title] = report
            print(f"\n{title}{': ' + ' '.join(base) if base else ''}\n\n| | ms | FLIP | relMSE | PSNR | SSIM | signed mean | front |")
            print("|---|---|---|---|---|---|---|---|")
            for point in report["points"]:
                print(row(point, report["reference"]["mean"]), flush=True)
            for slope in report["slopes"]:
                if slope["metric"] == "relmse" and slope["points"] > 2:
                    at = ", ".join(f"{knob} {value}" for knob, value in slope["at"].items())
                    print(f"\nrelMSE goes with {slope['knob']} to the power {slope['slope']:+.2f} +- {slope['spread']:.2f}"
                          f"{' at ' + at if at else ''}")
    if options.json:
        options.json.write_text(json.dumps(reports, indent=1))


if __name__ == "__main__":
    main()
