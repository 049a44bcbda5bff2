"""The hash manifests have of pictures, for tests without libraries."""

import struct


def xxh64(data):
    """XXH64 with seed 0, as manifests have it."""
    p1, p2, p3, p4, p5 = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5
    mask = (1 << 64) - 1
    turn = lambda x, n: ((x << n) | (x >> (64 - n))) & mask
    mix = lambda acc, lane: turn((acc + lane * p2) & mask, 31) * p1 & mask
    words = struct.unpack(f"<{len(data) // 8}Q", data[:len(data) // 8 * 8])
    at = 0
    if len(words) >= 4:
        lanes = [(p1 + p2) & mask, p2, 0, -p1 & mask]
        while at + 4 <= len(words):
            lanes = [mix(lane, word) for lane, word in zip(lanes, words[at:at + 4])]
            at += 4
        value = sum(turn(lane, n) for lane, n in zip(lanes, (1, 7, 12, 18))) & mask
        for lane in lanes:
            value = ((value ^ mix(0, lane)) * p1 + p4) & mask
    else:
        value = p5
    value = (value + len(data)) & mask
    for word in words[at:]:
        value = (turn(value ^ mix(0, word), 27) * p1 + p4) & mask
    assert len(data) % 8 == 0
    value = (value ^ (value >> 33)) * p2 & mask
    value = (value ^ (value >> 29)) * p3 & mask
    return f"{value ^ (value >> 32):016x}"
