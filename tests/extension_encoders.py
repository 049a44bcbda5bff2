"""Encoders of pictures and meshes that leave every byte as it is: the formats without their savings.

What real encoders make is compared with its plain twin in scene/gltf/compression_test.cpp.
"""

import itertools
import struct


class BitWriter:
    """Bits from the lowest up, as WebP's lossless format has them."""

    def __init__(self):
        self.value, self.count = 0, 0

    def put(self, value, bits):
        self.value |= value << self.count
        self.count += bits

    def bytes(self):
        return self.value.to_bytes((self.count + 7) // 8, "little")


def webp(width, height, values):
    """A lossless WebP file: no transforms, no cache, and codes of 8 bits for every level of every channel."""
    bits = BitWriter()
    bits.put(0x2F, 8)
    bits.put(width - 1, 14)
    bits.put(height - 1, 14)
    bits.put(1, 1)  # alpha is used
    bits.put(0, 3)  # version
    bits.put(0, 1)  # no transform
    bits.put(0, 1)  # no color cache
    bits.put(0, 1)  # one group of codes
    for symbols in (280, 256, 256, 256):
        bits.put(0, 1)  # a normal code
        bits.put(12 - 4, 4)  # lengths of the lengths' code, in the format's order: 17 18 0 1 2 3 4 5 16 6 7 8
        for length in (0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1):
            bits.put(length, 3)
        bits.put(0, 1)  # all symbols follow
        for symbol in range(symbols):
            bits.put(1 if symbol < 256 else 0, 1)  # a length of 8, or none
    bits.put(1, 1)  # distances: a simple code
    bits.put(0, 1)  # of one symbol
    bits.put(0, 1)  # of one bit
    bits.put(0, 1)

    def reversed_level(level):
        return int(f"{level:08b}"[::-1], 2)
    for i in range(width * height):
        r, g, b, a = values[4 * i:4 * i + 4]
        for level in (g, r, b, a):
            bits.put(reversed_level(level), 8)
    body = bits.bytes()
    chunk = b"VP8L" + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)
    return b"RIFF" + struct.pack("<I", 4 + len(chunk)) + b"WEBP" + chunk


def zigzag(value, bits):
    return ((value << 1) ^ (value >> (bits - 1))) & ((1 << bits) - 1)


def varint(value):
    """Seven bits a byte, the lowest first."""
    packed = b""
    while value > 127:
        packed += bytes([value & 127 | 128])
        value >>= 7
    return packed + bytes([value])


def meshopt_attributes(rows):
    """The vertex codec: a byte's differences from vertex to vertex, 16 a group, each group as it is. `rows`: of bytes."""
    width = len(rows[0])
    packed, last = b"\xa0", rows[0]
    block = min(8192 // width // 16 * 16, 256)
    for start in range(0, len(rows), block):
        part = rows[start:start + block]
        groups = -(-len(part) // 16)
        for k in range(width):
            before = [last[k]] + [row[k] for row in part[:-1]]
            moves = [zigzag(((row[k] - b + 128) & 255) - 128, 8) for row, b in zip(part, before)]
            packed += b"\xff" * (-(-groups // 4)) + bytes(moves) + bytes(16 * groups - len(part))
        last = part[-1]
    return packed + bytes(max(0, 32 - width)) + bytes(rows[0])


def meshopt_triangles(indices):
    """The index codec: every triangle by its three corners."""
    packed, last = b"", 0
    for index in indices:
        packed += varint(zigzag(index - last, 32))
        last = index
    triangles = len(indices) // 3
    explicit = b"".join(b"\xff" + packed_triangle for packed_triangle in split_varints(packed, 3))
    return b"\xe1" + b"\xff" * triangles + explicit + bytes(16)


def split_varints(packed, count):
    parts, part, left = [], b"", count
    for byte in packed:
        part += bytes([byte])
        left -= byte < 128
        if left == 0:
            parts.append(part)
            part, left = b"", count
    return parts


def meshopt_indices(indices):
    """The sequence codec: differences from one of two earlier indices."""
    packed, last = b"\xd1", [0, 0]
    for i, index in enumerate(indices):
        which = i % 2
        packed += varint(zigzag(index - last[which], 32) << 1 | which)
        last[which] = index
    return packed + bytes(4)


def draco_sequential(triangles, attributes):
    """A mesh whose indices and attributes stand as they are: bitstream 2.2. `attributes`: (semantic's number, letter's
    number, rows, letter)."""
    count = len(attributes[0][2])
    packed = b"DRACO" + bytes([2, 2, 1, 0]) + struct.pack("<H", 0)
    packed += varint(len(triangles)) + varint(count) + b"\1" + bytes(itertools.chain(*triangles))
    packed += b"\1" + varint(len(attributes))
    for unique, (semantic, data_type, rows, _) in enumerate(attributes):
        packed += bytes([semantic, data_type, len(rows[0]), 0]) + varint(unique)
    packed += bytes(len(attributes))  # each of generic values
    for _, _, rows, letter in attributes:
        packed += struct.pack(f"<{count * len(rows[0])}{letter}", *itertools.chain(*rows))
    return packed
