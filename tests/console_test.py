#!/usr/bin/env python3
"""A resident session: what it draws has the bits of `hpr render`, on any number of ranks, whatever was changed before.

usage: console_test.py HPR

Prints what differs or is missing and leaves with 1.
"""

import json
import os
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile
import time

from program import HPR, expect, failures

CAMERA = ["--eye", "0.278,0.273,-0.8", "--at", "0.278,0.273,0.28"]
SAID = set()


def hpr(arguments, folder, said="", code=0):
    result = subprocess.run([HPR, *arguments], cwd=folder, input=said, capture_output=True, text=True, timeout=120,
                            check=False)
    expect(result.returncode == code, f"hpr {' '.join(arguments)} left with {result.returncode}, not {code}:\n"
          f"{result.stderr[-2000:]}")
    return result


def console(folder, lines, *options, code=0, scene="room.glb"):
    SAID.update(line.split()[0] for line in lines if line.strip() and not line.startswith("#"))
    return hpr(["console", scene, "--size", "96x64", *options], folder, "\n".join(lines) + "\n", code)


def change_scene(folder, source, target, change):
    """A copy of a .glb whose JSON went through `change`."""
    data = (folder / source).read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20:20 + length])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length:]
    (folder / target).write_bytes(data[:8] + struct.pack("<III", 20 + len(text) + len(rest), len(text), 0x4E4F534A) +
                                  text + rest)


def same_file(folder, a, b, what):
    expect((folder / a).read_bytes() == (folder / b).read_bytes(), f"{what}: {a} differs from {b}")


def named_nodes(document):
    return {node["name"]: node for node in document["nodes"] if "mesh" in node}


def make_room(folder):
    hpr(["scene", "make", "cornell", "-o", "plain.glb"], folder)

    def name_all(document):
        for i, node in enumerate(document["nodes"]):
            node["name"] = f"thing {i}" if "mesh" in node else f"other {i}"

    change_scene(folder, "plain.glb", "room.glb", name_all)


def draws_as_render_does(folder):
    console(folder, ["render", "save console.png", "stats console.json"])
    hpr(["render", "room.glb", "--size", "96x64", "-o", "render.png"], folder)
    same_file(folder, "console.png", "render.png", "the scene as loaded")
    expect(json.loads((folder / "console.json").read_text())["schema"] == "hpr.stats/1", "stats writes no hpr.stats/1")

    console(folder, ["size 80x48", "quality draft", "spp 2", "passes shadow", "strategy tree", "set max-depth 3",
                     "camera 0.3,0.3,-0.9 at 0.28,0.27,0.28 up 0,1,0 fov 35", "explain", "render", "save other.exr"])
    hpr(["render", "room.glb", "--size", "80x48", "--quality", "draft", "--spp", "2", "--passes", "shadow", "--max-depth",
         "3", "--eye", "0.3,0.3,-0.9", "--at", "0.28,0.27,0.28", "--fov", "35", "-o", "other-render.exr"], folder)
    result = hpr(["diff", "other.exr", "other-render.exr", "--fail", "0"], folder)
    expect(result.returncode == 0, "options set line by line draw another picture")


def changes_are_those_of_a_file(folder):
    document = {}
    change_scene(folder, "room.glb", "same.glb", document.update)
    name = sorted(named_nodes(document))[-1]
    place = named_nodes(document)[name].get("translation", [0, 0, 0])

    def without(changed):
        named_nodes(changed)[name].pop("mesh")

    def moved(changed):
        node = named_nodes(changed)[name]
        expect("matrix" not in node, "the test needs nodes without a matrix")
        node["translation"] = [place[0] - 0.0625, place[1] + 0.125, place[2] + 0.03125]

    change_scene(folder, "room.glb", "without.glb", without)
    change_scene(folder, "room.glb", "moved.glb", moved)
    for scene in ("without", "moved"):
        # One that is taken away changes the camera that frames the scene: both look from the same place.
        hpr(["render", f"{scene}.glb", "--size", "96x64", *CAMERA, "-o", f"{scene}.exr"], folder)
    hpr(["render", "room.glb", "--size", "96x64", *CAMERA, "-o", "room.exr"], folder)
    for ranks in (1, 3):
        out = f"-{ranks}.exr"
        console(folder, [f"camera {CAMERA[1]} at {CAMERA[3]}", "nodes", "cameras", f'hide "{name}"', "render", f"save without{out}",
                         f'show "{name}"', f'move "{name}" by -0.0625,0.125,0.03125', "render", f"save moved{out}",
                         f'move "{name}" to {place[0]},{place[1]},{place[2]}', "render", f"save room{out}",
                         f'turn "{name}" 0,1,0 30', "render", f"save turned{out}"], "--ranks", str(ranks))
        for scene in ("without", "moved", "room"):
            result = hpr(["diff", f"{scene}{out}", f"{scene}.exr", "--fail", "0"], folder)
            expect(result.returncode == 0, f"{ranks} ranks: {scene} differs from the file's picture")
        for scene in ("without", "moved", "turned"):
            hpr(["diff", f"{scene}{out}", "room.exr", "--fail", "0"], folder, code=1)
    same_file(folder, "turned-1.exr", "turned-3.exr", "the same script on another number of ranks")


def lights_and_loading(folder):
    listed = console(folder, ["lights"], scene="gen:gallery").stdout
    name = '"' + listed.splitlines()[0].split(":")[0] + '"'
    script = [f"light {name} intensity 0,0,0", "render", "save dark.png", f"light {name} off", "render", "save off.png",
              f"light {name} on", f"light {name} intensity 40,10,10", f"light {name} position 0,4,0", "render", "save red.png",
              "load room.glb", "render", "save loaded.png", "quit", "render"]
    result = console(folder, script, "--passes", "shadow", scene="gen:gallery")
    same_file(folder, "dark.png", "off.png", "a light without intensity is a light put out")
    expect((folder / "red.png").read_bytes() != (folder / "dark.png").read_bytes(), "a light changes nothing")
    expect(result.stdout.count("pixels,") == 4, f"after quit nothing is drawn:\n{result.stdout}")
    hpr(["render", "room.glb", "--size", "96x64", "--passes", "shadow", "-o", "fresh.png"], folder)
    same_file(folder, "loaded.png", "fresh.png", "a scene loaded later")
    console(folder, script, "--passes", "shadow", "--force", "--ranks", "2", scene="gen:gallery")
    same_file(folder, "loaded.png", "fresh.png", "a scene loaded later by two ranks")


def mistakes(folder):
    result = console(folder, ["rendr", "save never.png"], code=2)
    expect("did you mean 'render'" in result.stderr, f"the nearest command is not named: {result.stderr}")
    expect(not (folder / "never.png").exists(), "a script went on after its mistake")
    result = console(folder, ["save early.png", "hide nothing", "move x", "size big", "set photons -1", "set stats x.json",
                              "load missing.glb", "camera 3", "save nowhere/x.png", "render", "save nowhere/x.png",
                              "save late.png"], "--keep-going", code=4)
    expect(result.stderr.count("hpr: error:") == 10, f"ten mistakes, each told once:\n{result.stderr}")
    expect((folder / "late.png").read_bytes() == (folder / "render.png").read_bytes(), "a mistake changed the picture")


def say(connection, line):
    connection.sendall(line.encode() + b"\n")
    answer = b""
    while not (answer.endswith(b"\n") and (answer.splitlines()[-1] == b"ok" or answer.startswith(b"error:"))):
        part = connection.recv(4096)
        if not part:
            break
        answer += part
    return answer.decode()


def over_a_socket(folder):
    path = str(folder / "s")
    for ranks in ("1", "2"):
        with subprocess.Popen([HPR, "console", "room.glb", "--size", "96x64", "--listen", path, "--ranks", ranks],
                              cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as job:
            deadline = time.monotonic() + 60
            while not os.path.exists(path) and time.monotonic() < deadline and job.poll() is None:
                time.sleep(0.02)
            with socket.socket(socket.AF_UNIX) as connection:
                connection.settimeout(60)
                connection.connect(path)
                expect(say(connection, "help").endswith("ok\n"), "help over a socket")
                expect(say(connection, "hide nothing").startswith("error: the scene has no node"), "a mistake over a socket")
                expect("pixels" in say(connection, "render"), "render over a socket")
                say(connection, f"save socket-{ranks}.png")
                say(connection, "quit")
            expect(job.wait(timeout=60) == 0, f"a session over a socket left with {job.returncode}")
        same_file(folder, f"socket-{ranks}.png", "render.png", "a picture asked for over a socket")


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-console-") as scratch:
        folder = pathlib.Path(scratch)
        make_room(folder)
        draws_as_render_does(folder)
        changes_are_those_of_a_file(folder)
        lights_and_loading(folder)
        mistakes(folder)
        over_a_socket(folder)
        listed = console(folder, ["help"]).stdout
        commands = {line.split()[0] for line in listed.splitlines() if line}
        expect(commands and commands <= SAID, f"commands without a test: {sorted(commands - SAID)}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
