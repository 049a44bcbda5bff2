"""Reads the EXR files hpr writes: one part, scan lines, ZIP or no compression, FLOAT and UINT channels."""

import array
import struct
import zlib

COMPRESSED_LINES = {0: 1, 2: 1, 3: 16}  # none, ZIPS, ZIP
LETTERS = {0: "I", 2: "f"}


def text_at(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def attributes(data):
    found = {}
    at = 8
    while data[at] != 0:
        name, at = text_at(data, at)
        kind, at = text_at(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        found[name] = (kind, data[at + 4:at + 4 + size])
        at += 4 + size
    return found, at + 1


def channel_list(value):
    channels = []
    at = 0
    while value[at] != 0:
        name, at = text_at(value, at)
        (kind,) = struct.unpack_from("<i", value, at)
        channels.append((name, LETTERS[kind]))
        at += 16
    return channels


def unpacked(block, size):
    """Undoes ZIP compression: bytes are split into two halves, and each stands as its difference to the one before."""
    if len(block) == size:
        return block
    raw = bytearray(zlib.decompress(block))
    for i in range(1, size):
        raw[i] = (raw[i - 1] + raw[i] - 128) & 255
    half = (size + 1) // 2
    whole = bytearray(size)
    whole[0::2] = raw[:half]
    whole[1::2] = raw[half:]
    return bytes(whole)


def read(path):
    """(width, height, {channel: array of values, row by row})."""
    data = path.read_bytes()
    if struct.unpack_from("<I", data)[0] != 20000630:
        raise ValueError(f"{path}: no EXR file")
    header, at = attributes(data)
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"][1])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels = channel_list(header["channels"][1])
    lines = COMPRESSED_LINES[header["compression"][1][0]]
    values = {name: array.array(letter) for name, letter in channels}
    for block in range(-(-height // lines)):
        (offset,) = struct.unpack_from("<Q", data, at + 8 * block)
        y, size = struct.unpack_from("<ii", data, offset)
        rows = min(lines, y1 + 1 - y)
        pixels = unpacked(data[offset + 8:offset + 8 + size], rows * width * 4 * len(channels))
        place = 0
        for _ in range(rows):
            for name, _ in channels:
                values[name].frombytes(pixels[place:place + 4 * width])
                place += 4 * width
    return width, height, values
