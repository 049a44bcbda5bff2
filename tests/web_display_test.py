#!/usr/bin/env python3
"""The web display serves the wall to who has its key, and to nobody else.

usage: web_display_test.py HPR

Prints what was wrong and leaves with 1.
"""

import http.client
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse

import png
from processes import children_of, ranks_of

HPR = os.path.abspath(sys.argv[1])
WALL, SCENE = "2x1@160x120", ["gen:gallery", "--passes", "none"]
MOST = 8  # connections
failures = []


def complain(message):
    failures.append(message)
    print(message)


def check(what, found, wanted):
    if found != wanted:
        complain(f"{what}: {found!r} instead of {wanted!r}")


class Site:
    def __init__(self, url):
        parts = urllib.parse.urlsplit(url)
        self.host, self.port, self.query = parts.hostname, parts.port, parts.query
        self.cookie = None

    def ask(self, path, method="GET", body=None, **headers):
        """(status, headers, body); headers are written with underscores."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=20)
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        if self.cookie and "Cookie" not in sent:
            sent["Cookie"] = self.cookie
        connection.request(method, path, body, sent)
        response = connection.getresponse()
        answer = response.status, response.headers, response.read()
        connection.close()
        return answer

    def parts(self, path="/stream"):
        """The parts of a stream, as (frame, JPEG)."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=20)
        connection.request("GET", path, headers={"Cookie": self.cookie})
        response = connection.getresponse()
        check(f"status of {path}", response.status, 200)
        boundary = response.headers.get_param("boundary", header="content-type")
        try:
            while True:
                check("boundary", response.readline().strip().decode(), f"--{boundary}")
                head = {}
                for line in iter(response.readline, b"\r\n"):
                    name, value = line.decode().split(":", 1)
                    head[name.lower()] = value.strip()
                jpeg = response.read(int(head["content-length"]))
                response.readline()
                yield int(head["x-frame"]), jpeg
        finally:
            connection.close()

    def post(self, motion, **headers):
        body = motion if isinstance(motion, str) else json.dumps(motion)
        return self.ask("/camera", "POST", body, **{"Content_Type": "application/json", **headers})[0]


def opaque(folder, name):
    """reference.png without an alpha, as JPEG has none."""
    width, height, rgba = png.read(folder / name)
    rgb = bytearray(3 * width * height)
    for channel in range(3):
        rgb[channel::3] = rgba[channel::4]
    png.write(folder / "reference.png", width, height, bytes(rgb), 3)


def difference(folder, jpeg, reference):
    """PSNR in dB; none where the sizes differ."""
    (folder / "part.jpg").write_bytes(jpeg)
    opaque(folder, reference)
    result = subprocess.run([HPR, "diff", "reference.png", "part.jpg", "--metric", "psnr", "--json"], cwd=folder,
                            capture_output=True, text=True, timeout=60, check=False)
    if not result.stdout.startswith("{"):
        return None
    psnr = json.loads(result.stdout)["psnr"]
    return 99.0 if psnr is None else psnr


def doors(site):
    token = site.query.split("=")[1]
    check("without a key", site.ask("/")[0], 403)
    check("a wrong token", site.ask("/?token=" + "0" * 32)[0], 403)
    check("the token in another place", site.ask("/status?token=" + token)[0], 403)
    check("another host's name", site.ask("/?" + site.query, Host="evil.example")[0], 403)
    status, headers, _ = site.ask("/?" + site.query)
    check("the right token", (status, headers["Location"]), (303, "/"))
    cookie = headers["Set-Cookie"]
    if "HttpOnly" not in cookie or "SameSite" not in cookie:
        complain(f"cookie {cookie!r}")
    site.cookie = cookie.split(";")[0]
    check("a wrong cookie", site.ask("/", Cookie=site.cookie[:-1] + "x")[0], 403)
    check("another host's name, with the key", site.ask("/", Host="evil.example")[0], 403)
    check("a page of another site", site.ask("/status", Origin="http://evil.example")[0], 403)
    check("its POST", site.post({"dolly": 1}, Origin="http://evil.example"), 403)
    check("a POST as a form sends it", site.ask("/camera", "POST", "{}", Content_Type="text/plain")[0], 400)
    check("a POST that is no motion", site.post("[1, 2]"), 400)
    check("GET of the camera", site.ask("/camera")[0], 405)
    check("POST of a page", site.ask("/", "POST", "{}")[0], 405)
    check("DELETE", site.ask("/", "DELETE")[0], 405)
    check("what is not there", site.ask("/etc/passwd")[0], 404)
    check("a screen that is not there", site.ask("/screen/nowhere")[0], 404)
    check("5000 bytes of body", site.post("{" + " " * 5000), 413)
    check("20000 bytes of header", site.ask("/", X_Long="x" * 20000)[0], 431)


def pages(site):
    status, headers, body = site.ask("/")
    check("the page", (status, headers["Content-Type"]), (200, "text/html; charset=utf-8"))
    policy = headers["Content-Security-Policy"]
    nonce = policy.split("script-src 'nonce-")[1].split("'")[0]
    if "default-src 'none'" not in policy or f'<script nonce="{nonce}">'.encode() not in body:
        complain(f"policy {policy!r} does not fit the page")
    if b'src="/stream"' not in body or b'href="/screen/' not in body:
        complain("the page lacks the stream or the screens")
    screen = body.split(b'href="/screen/')[1].split(b'"')[0].decode()
    if f'src="/stream/{screen}"'.encode() not in site.ask(f"/screen/{screen}")[2]:
        complain("a screen's page lacks its stream")
    return screen


def pictures(site, folder, screen):
    frames = site.parts()
    # Frame 0 is made in a hurry; while the camera rests frame 1 has all its pixels.
    first, jpeg = next((number, jpeg) for number, jpeg in frames if number >= 1)
    psnr = difference(folder, jpeg, "files/wall.png")
    if psnr is None or psnr < 30:
        complain(f"the first frame is {psnr} dB from the file display's wall")
    alone = next(site.parts(f"/stream/{screen}"))[1]
    psnr = difference(folder, alone, f"files/{screen}.png")
    if psnr is None or psnr < 30:
        complain(f"screen {screen} is {psnr} dB from the file display's")
    status = json.loads(site.ask("/status")[2])
    if status["frame"] < first or "fps" not in status:
        complain(f"status {status} after frame {first}")

    check("a motion", site.post({"turn": [0.5, 0.1], "dolly": 0.2}), 204)
    for number, jpeg in frames:
        if number <= first:
            continue  # what does not change is sent again
        psnr = difference(folder, jpeg, "files/wall.png")
        if psnr is None or psnr > 25:
            complain(f"after the camera moved, frame {number} is {psnr} dB from where it was")
        break
    frames.close()


def crowd(site):
    """Connections beyond the eighth are told so, and there is room again once they are gone."""
    open_ones = []
    end = time.monotonic() + 15  # streams that were left are noticed after a while
    while len(open_ones) < MOST and time.monotonic() < end:
        one = socket.create_connection((site.host, site.port), timeout=20)
        one.sendall(f"GET /status HTTP/1.1\r\nHost: localhost\r\nCookie: {site.cookie}\r\n\r\n".encode())
        if one.recv(12) == b"HTTP/1.1 200":
            open_ones.append(one)
        else:
            one.close()
            time.sleep(0.2)
    check("connections", len(open_ones), MOST)
    check("the ninth connection", site.ask("/status")[0], 503)
    for one in open_ones:
        one.close()
    end = time.monotonic() + 15
    status = 503
    while status == 503 and time.monotonic() < end:
        time.sleep(0.2)
        status = site.ask("/status")[0]
    check("once they have left", status, 200)


def idle_connections(site):
    """Connections that say nothing, more than are kept, keep nobody out who has the token."""
    idle = [socket.create_connection((site.host, site.port), timeout=20) for _ in range(60)]
    begin = time.monotonic()
    check("beside idle connections", site.ask("/status")[0], 200)
    if time.monotonic() - begin > 5:
        complain("an answer beside idle connections took longer than these are given")
    for one in idle:
        one.close()


def serve(folder, ranks):
    process = subprocess.Popen([HPR, "wall", "run", WALL, *SCENE, "--display", "web", "--spp", "1", "--target-ms", "60000",
                                "--ranks", ranks], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        url = process.stdout.readline().strip()
        if not url.startswith("http://127.0.0.1:") or "/?token=" not in url:
            complain(f"the address {url!r}")
            return
        site = Site(url)
        doors(site)
        screen = pages(site)
        pictures(site, folder, screen)
        crowd(site)
        idle_connections(site)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30)[1]
        check(f"SIGINT with {ranks} ranks ({said[-500:]!r})", process.returncode, 0)
    finally:
        if process.poll() is None:
            process.kill()
            print(process.communicate()[1][-2000:])


def ends_while_photons_are_traced(folder, ranks):
    """A resting picture of so many photons that one sample takes minutes: a signal does not wait for them."""
    process = subprocess.Popen([HPR, "view", "gen:gallery", "--size", "160x120", "--web", "--quality", "best", "--photons", "100000000",
                                "--ranks", ranks], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        process.stdout.readline()
        time.sleep(1.0)  # the first picture, of a moving camera, has no photons
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=15)
        check(f"SIGTERM among photons with {ranks} ranks", process.returncode, 0)
    except subprocess.TimeoutExpired:
        complain(f"{ranks} ranks trace all photons of a sample before they end")
    finally:
        if process.poll() is None:
            for pid in [*ranks_of(process.pid), *children_of(process.pid), process.pid]:
                os.kill(pid, signal.SIGKILL)
        process.communicate()


def main():
    with tempfile.TemporaryDirectory(prefix="hpr-web-") as scratch:
        folder = pathlib.Path(scratch)
        subprocess.run([HPR, "wall", "run", WALL, *SCENE, "--display", "file", "-o", "files"], cwd=folder, check=True,
                       capture_output=True, timeout=120)
        for ranks in ("1", "2"):
            serve(folder, ranks)
            ends_while_photons_are_traced(folder, ranks)
        for display, code in (("web=example.org:1", 2), ("web=127.0.0.1:99999", 2), ("web=203.0.113.1:1", 4)):
            result = subprocess.run([HPR, "wall", "run", "1x1@32x32", *SCENE, "--display", display], cwd=folder,
                                    capture_output=True, timeout=60, check=False)
            check(f"--display {display}", result.returncode, code)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
