"""What tests of `--backend vulkan` call in common."""

import json
import os
import pathlib
import tempfile

from program import expect, failures, run

# What devices are compared with is the CPU's and OpenGL's, on machines with a GPU as well.
NO_VULKAN = {**os.environ, "VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}

SIZE = (96, 72)
OTHERS_LIT = 0.05  # a ray of theirs meets another surface, or a sample more is taken


def hpr(folder, *arguments, code=0):
    result = run(folder, *arguments, env=None if "vulkan" in arguments else NO_VULKAN)
    expect(result.returncode == code, f"{' '.join(arguments)}: left with {result.returncode}: {result.stderr[-800:]}")
    return result


def render(folder, scene, *arguments, photons="2000"):
    """The bytes of the keys and of the picture."""
    hpr(folder, "render", scene, "--size", f"{SIZE[0]}x{SIZE[1]}", "--photons", photons, "--raw", "a.keys", "-o", "a.exr", "--force", *arguments)
    return (folder / "a.keys").read_bytes(), (folder / "a.exr").read_bytes()


def has_device(folder):
    findings = json.loads(run(folder, "doctor", "--json").stdout)["findings"]
    return next(finding for finding in findings if finding["name"] == "Vulkan")["status"] == "ok"


def nearly_equal(folder, expected, found, what, allowed=1e-5):
    diff = json.loads(run(folder, "diff", expected, found, "--json").stdout)
    expect(diff["relmse_untrimmed"] <= allowed and diff["not_finite"] == 0, f"{what}: relMSE {diff['relmse_untrimmed']}")
    expect(diff["differing"] <= OTHERS_LIT * diff["pixels"] or diff["max"] < 1e-3, f"{what}: {diff['differing']} pixels differ")


def run_parts(*parts):
    """A test's exit code: each part is called with a folder to write to."""
    with tempfile.TemporaryDirectory(prefix="hpr-vulkan-") as scratch:
        folder = pathlib.Path(scratch)
        if not has_device(folder):
            print("Vulkan has no device here that can do hpr's work")
            return 77
        for part in parts:
            part(folder)
    return 1 if failures else 0
