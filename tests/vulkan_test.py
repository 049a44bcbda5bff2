#!/usr/bin/env python3
"""`--backend vulkan` and `auto`: who makes keys and light is said and kept to, and what a device cannot do is done or said.

usage: vulkan_test.py HPR

Prints what was wrong and leaves with 1; with 77 where Vulkan has no device.
"""

import json
import subprocess
import sys
import time

from program import HPR, expect, run
from vulkan_program import NO_VULKAN, hpr, nearly_equal, render, run_parts


def left_open(folder):
    """--backend auto: without a GPU as ever, with one as --backend vulkan."""
    devices = next(f for f in json.loads(run(folder, "doctor", "--json").stdout)["findings"] if f["name"] == "Vulkan")["devices"]
    expect(all(set(d) == {"index", "name", "driver", "memory_bytes", "software", "use", "backend", "why"} for d in devices), f"devices: {devices}")
    by_gpu = any(device["backend"] == "auto" for device in devices)
    settings = ("render", "gen:cornell", "--size", "64x48", "--spp", "1", "--quality", "draft", "--explain", "--force", "-o")
    for arguments in ((), ("--ranks", "2")):
        said = run(folder, *settings, "auto.png", *arguments)
        words = said.stdout + said.stderr
        expect(("device: " in words) == by_gpu and "Vulkan" not in said.stderr, f"auto with GPUs {by_gpu}: {words[-800:]}")
        expect(("light: on the device" in words) == by_gpu, f"auto with GPUs {by_gpu}: {words[-800:]}")
    if not by_gpu:
        hpr(folder, *settings, "cpu.png")
        expect((folder / "auto.png").read_bytes() == (folder / "cpu.png").read_bytes(), "auto is another picture where there is no GPU")


def device_row(folder):
    """--trace has the device's passes in a row of their own, one after the other."""
    hpr(folder, "render", "gen:cornell", "--size", "64x48", "--spp", "2", "--quality", "draft", "-o", "t.png", "--backend", "vulkan", "--trace", "t.json")
    events = json.loads((folder / "t.json").read_text())["traceEvents"]
    row = [e["tid"] for e in events if e["ph"] == "M" and e["name"] == "thread_name" and e["args"]["name"] == "device"]
    expect(len(row) == 1, f"rows of the device: {row}")
    spans = sorted((e for e in events if e["ph"] == "X" and e["tid"] in row), key=lambda e: (e["ts"], e["ts"] + e["dur"]))
    has_clock = any(e["name"] != "device" for e in spans)
    wanted = {"device keys", "device read-back", "device start", "device direct", "device finish"} if has_clock else {"device"}
    expect(wanted <= {e["name"] for e in spans}, f"passes: { {e['name'] for e in spans} }")
    expect(all(a["ts"] + a["dur"] <= b["ts"] + 1e-3 for a, b in zip(spans, spans[1:])), "passes of one device overlap")
    light = [e for e in events if e["ph"] == "X" and e["name"] == "light"]
    lit = [s for s in spans if s["name"] == ("device direct" if has_clock else "device")]
    inside = [s for s in lit if any(e["ts"] <= s["ts"] and s["ts"] + s["dur"] <= e["ts"] + e["dur"] + 1 for e in light)]
    expect(inside, "no light while the device lights")


def target_time(folder):
    """What is given up for time leaves light where it is."""
    (folder / "walk.txt").write_text("eye -4,1.7,4 at 0,1.6,-2\n\neye 4,1.7,3 at 2,1.5,-2 fov 60\n")
    walk = ("wall", "run", "2x1@40x32", "gen:gallery", "--quality", "draft", "--path", "walk.txt", "--frames", "8", "--target-ms", "0.5",
            "--backend", "vulkan", "--stats", "b.json", "-o", "walk", "--force", "--explain")
    for settings, by_device in ((("--spp", "1"), True), (("--spp", "2", "--half-resolution", "shadow"), False)):
        said = hpr(folder, *walk, *settings)
        expect(("light: on the device" in said.stdout) == by_device, f"{settings}: {said.stdout[-600:]}")
        frames = [f["budget"] for f in json.loads((folder / "walk" / "manifest.json").read_text())["frames"]]
        expect(frames[-1]["resolution_scale"] < 0.3, f"{settings}: given up: {frames[-1]}")
        given_up = any("half-resolution" in f["given_up"] for f in frames)
        expect(given_up != by_device, f"{settings}: half resolution in {frames}")
        lit = {p["name"]: p["ms"] for p in json.loads((folder / "b.json").read_text())["passes"]}
        expect((lit.get("device direct", 0) > 0) == by_device, f"{settings}: the last frame's light: {lit}")


def interrupted(folder, settings, state):
    """A run that ends once it has a checkpoint."""
    process = subprocess.Popen([HPR, *settings], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=NO_VULKAN if "vulkan" not in settings else None)
    end = time.monotonic() + 100
    while not (folder / state).exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    process.terminate()
    process.wait(timeout=60)
    expect((folder / state).exists(), f"{' '.join(settings)}: left no checkpoint")


def resumed(folder):
    """Samples of a device and of the CPU do not mix, whoever chose the device."""
    by_device = ("--backend", "vulkan")
    for name, first, then in (("by-device", by_device, ()), ("by-cpu", (), by_device)):
        settings = ("render", "gen:cornell", "--size", "32x24", "--quality", "draft", "--spp", "100000", "-o", f"{name}.exr", "--checkpoint", f"{name}.hpr",
                    "--checkpoint-every", "0.1s")
        interrupted(folder, (*settings, *first), f"{name}.hpr")
        said = hpr(folder, *settings, "--resume", *then, code=3)
        expect("device" in said.stderr, f"{name}: resumed with {then}: {said.stderr[-600:]}")


def said_and_done(folder):
    said = hpr(folder, "render", "gen:cornell", "--size", "64x48", "-o", "b.png", "--backend", "vulkan", "--explain")
    words = said.stdout + said.stderr
    expect("light: on the device" in words, f"the CPU lights a first picture: {words[-800:]}")
    expect("primary: rays (by " in words and "--backend vulkan" in words, f"does not say who makes the keys: {words[-800:]}")
    said = hpr(folder, "render", "gen:cornell", "--size", "64x48", "-o", "c.png", "--backend", "vulkan", "--device", "99", code=2)
    expect("there is no Vulkan device 99" in said.stderr and "0: " in said.stderr, f"device 99: {said.stderr}")
    # What devices do not do is done by Embree or OpenGL, and looks the same.
    plain = render(folder, "gen:gallery", "--ranks", "2", "--data", "partitioned")
    expect(render(folder, "gen:gallery", "--ranks", "2", "--data", "partitioned", "--backend", "vulkan") == plain, "parts of scenes")
    draft = ("--quality", "draft")
    for settings, reason in (((*draft, "--aov", "albedo"), "further layers"), ((*draft, "--half-resolution", "shadow"), "half resolution"),
                             ((*draft, "--light-samples", "128"), "light samples")):
        said = hpr(folder, "render", "gen:cornell", "--size", "64x48", "--spp", "1", "-o", "e.exr", "--force", "--backend", "vulkan", "--explain", *settings)
        words = said.stdout + said.stderr
        expect("light: by the CPU (" in words and reason in words, f"{settings}: {words[-800:]}")
    few = ("--size", "64x48", "--spp", "20", "--adaptive", "--primary", "rays", "--force")
    hpr(folder, "render", "gen:cornell", "-o", "few.exr", *few)
    hpr(folder, "render", "gen:cornell", "-o", "few-gpu.exr", "--backend", "vulkan", *few)
    nearly_equal(folder, "few.exr", "few-gpu.exr", "adaptive samples", allowed=1e-3)
    drawn = ("--primary", "raster", "--depth-format", "24")
    keys = render(folder, "gen:cornell", *drawn, "--backend", "vulkan")[0]
    (folder / "a.exr").rename(folder / "lit.exr")
    expect(render(folder, "gen:cornell", *drawn)[0] == keys, "OpenGL beside Vulkan")
    nearly_equal(folder, "a.exr", "lit.exr", "OpenGL's keys lit by a device")
    said = hpr(folder, "render", "gen:gallery", "--size", "128x96", "-o", "d.png", "--backend", "vulkan", "--ranks", "3", "--distribute", "sort-last",
               "--verify", "100", *draft, "--spp", "1")
    expect("differ" not in said.stderr, f"drawn again, keys are others: {said.stderr[-800:]}")
    hpr(folder, "wall", "run", "2x1@64x48", "gen:cornell", "-o", "wall", "--frames", "2", "--backend", "vulkan", "--ranks", "2", *draft, "--spp", "1")
    expect((folder / "wall" / "wall.png").exists(), "a wall has no picture")


if __name__ == "__main__":
    sys.exit(run_parts(left_open, device_row, target_time, resumed, said_and_done))
