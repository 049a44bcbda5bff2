#!/usr/bin/env python3
"""The strategy of docs/examples/strategy, built against an installation, keeps the contract and joins `hpr compare`.

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


def check_refusals(hpr, bad):
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
            "foreach(kind plain other taken)\n  add_library(${kind} MODULE ${kind}.cpp)\n"
            "  target_link_libraries(${kind} PRIVATE hpr::compositing)\n"
            "  set_target_properties(${kind} PROPERTIES OUTPUT_NAME bad LIBRARY_OUTPUT_DIRECTORY ${kind})\nendforeach()\n")
        for kind, text in (("plain", PLAIN), ("other", OTHER_BUILD), ("taken", TAKEN)):
            (bad / f"{kind}.cpp").write_text(text)
        build(bad, bad, prefix)
        check_refusals(hpr, bad)

    print(f"{len(failures)} failed" if failures else "the example is part of the comparison")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
