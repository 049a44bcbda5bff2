"""Reads the PNG files hpr writes: 8 bits a channel, RGBA, not interlaced."""

import struct
import zlib


def chunks(data):
    at = 8
    while at < len(data):
        (size,) = struct.unpack_from(">I", data, at)
        yield data[at + 4:at + 8], data[at + 8:at + 8 + size]
        at += 12 + size


def paeth(left, up, corner):
    near = left + up - corner
    distances = (abs(near - left), abs(near - up), abs(near - corner))
    return (left, up, corner)[distances.index(min(distances))]


def unfilter(kind, row, before):
    for i, value in enumerate(row):
        left = row[i - 4] if i >= 4 else 0
        up = before[i]
        corner = before[i - 4] if i >= 4 else 0
        row[i] = (value + (0, left, up, (left + up) // 2, paeth(left, up, corner))[kind]) & 255
    return row


def read(path):
    """(width, height, bytes: RGBA row by row)."""
    return decode(path.read_bytes(), path)


def decode(data, path="data"):
    """The same of a file's bytes."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError(f"{path}: no PNG file")
    parts = list(chunks(data))
    width, height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", parts[0][1])
    if (depth, color, interlaced) != (8, 6, 0):
        raise ValueError(f"{path}: depth {depth}, colour type {color}, interlaced {interlaced}")
    raw = zlib.decompress(b"".join(body for name, body in parts if name == b"IDAT"))
    stride = 4 * width
    before = bytearray(stride)
    rows = []
    for y in range(height):
        at = y * (stride + 1)
        before = unfilter(raw[at], bytearray(raw[at + 1:at + 1 + stride]), before)
        rows.append(bytes(before))
    return width, height, b"".join(rows)


def write(path, width, height, values, channels=4):
    path.write_bytes(encode(width, height, values, channels))


def encode(width, height, values, channels=4):
    """A file's bytes: 8 bits a channel, RGB or RGBA row by row."""
    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    stride = channels * width
    rows = b"".join(b"\0" + values[stride * y:stride * (y + 1)] for y in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
