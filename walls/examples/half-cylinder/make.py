#!/usr/bin/env python3
"""Writes what a calibration would find of half-cylinder.toml: where the light of its two projectors falls (PFM position
maps), and how it is to fade where both light the screen (16-bit grey PNG).

usage: make.py FOLDER
"""

import math
import pathlib
import struct
import sys
import zlib

RADIUS, HEIGHT = 2.5, 2.6  # metres; the cylinder's axis is the y axis, its middle lies in -z
SHARED = 10  # degrees to each side of the middle that both light
PROJECTORS = {"left": (1.2, 2.9, 1.1, -42.0), "right": (-1.2, 2.9, 1.1, 42.0)}  # x, y, z, heading
WIDE, HIGH, DOWN = 0.7, 0.4375, 0.5  # half widths of a picture at one metre, and by how much its middle lies below


def lit(projector, s, t):
    """The point of the cylinder that a projector lights at (s, t) of its picture, from the upper left corner."""
    x, y, z, heading = projector
    angle = math.radians(heading)
    across, down = WIDE * (2 * s - 1), HIGH * (2 * t - 1) + DOWN
    dx = math.sin(angle) + across * math.cos(angle)
    dz = -math.cos(angle) + across * math.sin(angle)
    # x + k dx, z + k dz lies on the circle.
    a, b, c = dx * dx + dz * dz, x * dx + z * dz, x * x + z * z - RADIUS * RADIUS
    k = (-b + math.sqrt(b * b - a * c)) / a
    return x + k * dx, y - k * down, z + k * dz


def share(name, point):
    """Of all light that falls on a point, what this projector gives."""
    x, y, z = point
    degrees = math.degrees(math.atan2(x, -z))
    inside = SHARED - degrees if name == "left" else SHARED + degrees
    ramp = min(1.0, max(0.0, inside / (2 * SHARED)))
    # To the screen's rim in metres; the last 2 cm fade.
    rim = min(y, HEIGHT - y, math.radians(90 - abs(degrees)) * RADIUS)
    return ramp * min(1.0, max(0.0, rim / 0.02))


def write_pfm(path, projector, columns, rows):
    values = []
    for row in reversed(range(rows)):
        for column in range(columns):
            values += lit(projector, (column + 0.5) / columns, (row + 0.5) / rows)
    path.write_bytes(b"PF\n%d %d\n-1.0\n" % (columns, rows) + struct.pack(f"<{len(values)}f", *values))


def write_png(path, name, projector, columns, rows):
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    lines = b""
    for row in range(rows):
        levels = [round(65535 * share(name, lit(projector, (column + 0.5) / columns, (row + 0.5) / rows))) for column in range(columns)]
        lines += b"\0" + struct.pack(f">{columns}H", *levels)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 16, 0, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b""))


def main():
    folder = pathlib.Path(sys.argv[1])
    for name, projector in PROJECTORS.items():
        write_pfm(folder / f"{name}.pfm", projector, 48, 30)
        write_png(folder / f"{name}_alpha.png", name, projector, 480, 300)


if __name__ == "__main__":
    main()
