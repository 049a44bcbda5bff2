#!/usr/bin/env python3
"""The strategy of docs/examples/strategy, built against an installation, keeps the contract, joins `hpr compare` and
composites the frames of every command that draws.

usage: example_test.py HPR CMAKE BUILD SOURCE
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

CMAKE, BUILD, SOURCE = sys.argv[2:5]
EXAMPLE = pathlib.Path(SOURCE) / "docs" / "examples" / "strategy"
PLAIN = """#include "compositing/compositor.h"
int unrelated() { return 0; }
"""
OTHER_BUILD = """#include "compositing/plugin.h"
extern "C" const hpr::CompositorPlugin* hpr_compositor_plugin() {
  static const hpr::CompositorPlugin plugin{"0.0.0 (another)", nullptr};
  return &plugin;
}
"""
TAKEN = """#include "compositing/plugin.h"
struct Taken final : hpr::Compositor {
  std::string_view name() const override { return "serial"; }
  hpr::Composited composite(hpr::Communicator&, hpr::TileLayer<hpr::Key>&, std::span<const std::size_t>,
                            std::span<const int>) override {
    return {};
  }
};
HPR_COMPOSITOR_PLUGIN(Taken)
"""
SECOND = TAKEN.replace("serial", "second").replace("Taken", "Second")
failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)
        print(f"failed: {message}")


def run(*arguments, check=True):
    result = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, timeout=280, check=False)
    if check and result.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))} left with {result.returncode}\n{result.stdout}\n{result.stderr}")
    return result


def build(source, folder, prefix):
    run(CMAKE, "-S", source, "-B", folder, f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror")
    run(CMAKE, "--build", folder, "-j", str(len(os.sched_getaffinity(0))))


def check_compare(hpr, plugin):
    # Relative, without a slash: as a user beside the file would write it.
    result = subprocess.run([hpr, "compare", "--plugin", plugin.name, "--synthetic", "half", "--size", "320x200", "--ranks",
                             "1,2,5", "--frames", "2", "--warmup", "0", "--json"], cwd=plugin.parent,
                            capture_output=True, text=True, timeout=60, check=False)
    expect(result.returncode == 0, f"compare left with {result.returncode}: {result.stderr}")
    if result.returncode != 0:
        return
    report = json.loads(result.stdout)
    expect("--plugin libwide_tree.so" in report["command"], "the command of the report names the plugin")
    for ranks in (1, 2, 5):
        rows = {row["strategy"]: row for row in report["runs"] if row["ranks"] == ranks}
        expect("wide-tree" in rows, f"a row for the plugin on {ranks} ranks")
        expect(rows["wide-tree"]["differing_pixels"] == 0, f"no differing pixel on {ranks} ranks")
        expect(rows["wide-tree"]["frame_xxh64"] == rows["serial"]["frame_xxh64"], f"the frame of serial on {ranks} ranks")
        expect(rows["wide-tree"]["messages_total"] == 2 * (ranks - 1), f"one message a rank, and one to collect, on {ranks}")


def check_render(hpr, plugin, second):
    """Ranks that hpr starts load it too, and the pictures are those of a built-in strategy."""
    def call(*arguments):
        result = subprocess.run([hpr, *map(str, arguments)], cwd=plugin.parent, capture_output=True, text=True, timeout=120,
                                check=False)
        expect(result.returncode == 0, f"{arguments}: left with {result.returncode}: {result.stderr}")
        return result.stdout

    drawn = ["gen:cornell", "--size", "200x120", "--spp", "1", "--distribute", "sort-last", "--ranks", "5"]
    call("render", *drawn, "--strategy", "serial", "-o", "serial.png", "--raw", "serial.raw")
    # The strategy may be named before the plugin that brings it, and the scene after both.
    plan = call("render", "--strategy", "wide-tree", "--plugin", plugin.name, *drawn, "--explain", "-o", "mine.png", "--raw", "mine.raw")
    expect("composite: wide-tree among 5 ranks (as asked)" in plan, f"another strategy: {plan}")
    for kind in ("png", "raw"):
        expect((plugin.parent / f"mine.{kind}").read_bytes() == (plugin.parent / f"serial.{kind}").read_bytes(),
               f"render: another .{kind} than that of serial")

    hashes = {}
    for strategy in ("serial", "wide-tree"):
        call("--plugin", plugin.name, "--plugin", second, "wall", "run", "2x1@96x64", "gen:cornell", "--frames", "2", "--ranks", "3",
             "--distribute", "sort-last", "--strategy", strategy, "--display", "file", "-o", strategy)
        manifest = json.loads((plugin.parent / strategy / "manifest.json").read_text())
        expect({frame["strategy"] for frame in manifest["frames"]} == {strategy}, f"the manifest names another than {strategy}")
        hashes[strategy] = [[screen["xxh64"] for screen in frame["screens"]] for frame in manifest["frames"]]
    expect(hashes["serial"] == hashes["wide-tree"], f"wall run: other pictures than those of serial: {hashes}")

    rows = json.loads(call("bench", "scale", "gen:cornell", "--size", "96x64", "--ranks", "1,2", "--reps", "1", "--distribute",
                           "sort-last", "--strategy", "wide-tree", "--plugin", plugin.name, "--json"))
    expect(rows["pictures_agree"], "bench scale: other pictures")
    for transport in ("mpi", "threads"):
        rows = json.loads(call("compare", "gen:cornell", "--size", "96x64", "--ranks", "3", "--frames", "1", "--distribute", "sort-last",
                               "--strategy", "wide-tree", "--plugin", plugin.name, "--transport", transport, "--json"))["runs"]
        expect([(row["strategy"], row["differing_pixels"]) for row in rows] == [("wide-tree", 0)], f"compare --distribute: {rows}")


def check_refusals(hpr, bad, plugin):
    drawn = ["render", "gen:tetra", "-o", bad / "never.png", "--ranks", "2"]
    for words, code, mention in ((["--plugin", bad / "none.so"], 4, "none.so is no file"), (["--plugin", ""], 2, "--plugin"),
                                 (["--plugin", plugin, "--plugin", plugin], 3, "libwide_tree.so: there is a strategy named 'wide-tree'"),
                                 (["--plugin", plugin, "--strategy", "wide-tre"], 2, "did you mean 'wide-tree'")):
        result = run(hpr, *drawn, *words, check=False)
        expect(result.returncode == code, f"{words}: left with {result.returncode} instead of {code}: {result.stderr}")
        expect(mention in result.stderr and result.stderr.count("error:") == 1, f"{words}: does not say {mention!r}: {result.stderr}")
    ours = ["--synthetic", "half", "--size", "64x64", "--ranks", "2"]
    for name, code, words in (("none.so", 4, "none.so"), ("plain/libbad.so", 3, "brings no strategy"),
                              ("other/libbad.so", 3, "was built for HPR 0.0.0 (another)"),
                              ("taken/libbad.so", 3, "named 'serial' already"), ("text.so", 3, "cannot open")):
        result = run(hpr, "compare", "--plugin", bad / name, *ours, check=False)
        expect(result.returncode == code, f"{name}: left with {result.returncode} instead of {code}")
        expect(words in result.stderr, f"{name}: does not say {words!r}: {result.stderr}")
    unknown = run(hpr, "compare", *ours, "--strategies", "wide-tree", check=False)
    expect(unknown.returncode == 2, "without --plugin nobody knows its strategy")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-example-") as scratch:
        scratch = pathlib.Path(scratch)
        prefix = scratch / "prefix"
        run(CMAKE, "--install", BUILD, "--prefix", prefix)
        hpr = prefix / "bin" / "hpr"
        build(EXAMPLE, scratch / "example", prefix)

        contract = run(scratch / "example" / "contract_test", check=False)
        expect(contract.returncode == 0, f"the contract is kept:\n{contract.stdout[-3000:]}")
        ran = re.search(r"\[  PASSED  \] (\d+) tests", contract.stdout)
        expect(ran is not None and int(ran.group(1)) >= 40, "the contract holds at least 4 promises on 10 rank counts")
        check_compare(hpr, scratch / "example" / "libwide_tree.so")

        bad = scratch / "bad"
        bad.mkdir()
        (bad / "text.so").write_text("no shared object")
        (bad / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.25)\nproject(bad LANGUAGES C CXX)\nfind_package(HPR REQUIRED)\n"
            "foreach(kind plain other taken second)\n  add_library(${kind} MODULE ${kind}.cpp)\n"
            "  target_link_libraries(${kind} PRIVATE hpr::compositing)\n"
            "  set_target_properties(${kind} PROPERTIES OUTPUT_NAME bad LIBRARY_OUTPUT_DIRECTORY ${kind})\nendforeach()\n")
        for kind, text in (("plain", PLAIN), ("other", OTHER_BUILD), ("taken", TAKEN), ("second", SECOND)):
            (bad / f"{kind}.cpp").write_text(text)
        build(bad, bad, prefix)
        check_render(hpr, scratch / "example" / "libwide_tree.so", bad / "second" / "libbad.so")
        check_refusals(hpr, bad, scratch / "example" / "libwide_tree.so")

    print(f"{len(failures)} failed" if failures else "the example is part of the comparison")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
