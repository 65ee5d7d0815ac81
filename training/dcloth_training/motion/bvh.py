"""BVH reader. Input is treated as untrusted: every refusal names file, line and cause."""
import math
import os
from dataclasses import dataclass

import numpy as np

from . import retarget, rotations, skeleton

MAX_BYTES = 64 << 20
MAX_JOINTS = 512
MAX_FRAMES = 200_000
_CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


class BvhError(ValueError):
    """A file that is not a usable BVH clip."""


@dataclass
class BvhClip:
    """names, parents [J], offsets [J, 3], root [T, 3], local [T, J, 3, 3], frame_seconds."""
    names: list
    parents: np.ndarray
    offsets: np.ndarray
    root: np.ndarray
    local: np.ndarray
    frame_seconds: float


class _Tokens:
    """Words of the hierarchy section, with the line each stands on."""

    def __init__(self, path, text):
        self.path = path
        self.words = [(w, n) for n, line in enumerate(text.split("\n"), 1) for w in line.split()]
        self.at = 0

    def fail(self, what):
        line = self.words[min(self.at, len(self.words)) - 1][1] if self.words else 0
        raise BvhError(f"{self.path}:{line}: {what}")

    def next(self, expected=None):
        if self.at >= len(self.words):
            self.fail(f"file ends where {expected or 'a word'} was expected")
        word = self.words[self.at][0]
        self.at += 1
        if expected is not None and word != expected:
            self.fail(f"found '{word[:40]}', expected '{expected}'")
        return word

    def number(self, low=-1e6, high=1e6):
        word = self.next()
        try:
            value = float(word)
        except ValueError:
            self.fail(f"found '{word[:40]}', expected a number")
        if not math.isfinite(value) or not low <= value <= high:
            self.fail(f"number {word[:40]} outside {low:g}..{high:g}")
        return value

    def count(self, high, what):
        word = self.next()
        if not word.isdigit() or int(word) > high:
            self.fail(f"{what} is '{word[:40]}', expected 0..{high}")
        return int(word)


def _read_hierarchy(tokens):
    """Iterative, so a hostile file cannot exhaust the stack."""
    names, parents, offsets, channels = [], [], [], []
    tokens.next("HIERARCHY")
    stack, word = [], tokens.next("ROOT")
    while True:
        if word in ("ROOT", "JOINT"):
            if len(names) >= MAX_JOINTS:
                tokens.fail(f"more than {MAX_JOINTS} joints")
            name = tokens.next()
            if name in names:
                tokens.fail(f"joint '{name[:40]}' appears twice")
            tokens.next("{")
            tokens.next("OFFSET")
            names.append(name)
            parents.append(stack[-1] if stack else -1)
            offsets.append([tokens.number() for _ in range(3)])
            tokens.next("CHANNELS")
            channels.append([tokens.next() for _ in range(tokens.count(6, "channel count"))])
            unknown = [c for c in channels[-1] if c not in _CHANNELS]
            if unknown or len(set(channels[-1])) != len(channels[-1]):
                tokens.fail(f"channels {channels[-1]} unknown or repeated")
            stack.append(len(names) - 1)
        elif word == "End":
            for expected in ("Site", "{", "OFFSET"):
                tokens.next(expected)
            for _ in range(3):
                tokens.number()
            tokens.next("}")
        elif word == "}":
            stack.pop()
            if not stack:
                return names, parents, offsets, channels
        else:
            tokens.fail(f"found '{word[:40]}', expected JOINT, End or '}}'")
        word = tokens.next()


def read(path):
    """Read a BVH file -> BvhClip. Rotations multiply in channel order: R = R_1 R_2 R_3."""
    if os.path.getsize(path) > MAX_BYTES:
        raise BvhError(f"{path}: larger than {MAX_BYTES} bytes")
    with open(path, encoding="utf-8", errors="replace") as file:
        text = file.read()
    head, found, body = text.partition("MOTION")
    if not found:
        raise BvhError(f"{path}: no MOTION section")
    tokens = _Tokens(path, head)
    names, parents, offsets, channels = _read_hierarchy(tokens)
    if tokens.at != len(tokens.words):
        tokens.fail("words after the hierarchy's last '}'; only one root is supported")
    tokens = _Tokens(path, "\n".join(body.split("\n")[:4]))
    tokens.next("Frames:")
    frames = tokens.count(MAX_FRAMES, "frame count")
    tokens.next("Frame")
    tokens.next("Time:")
    frame_seconds = tokens.number(1e-4, 10.0)
    width = sum(map(len, channels))
    values = body.split("Time:", 1)[1].split()[1:]
    if frames == 0 or len(values) != frames * width:
        raise BvhError(f"{path}: {len(values)} motion values, expected {frames} frames x {width}")
    try:
        data = np.array(list(map(float, values))).reshape(frames, width)
    except ValueError as error:
        raise BvhError(f"{path}: motion values: {error}") from None
    if not np.isfinite(data).all() or np.abs(data).max() > 1e6:
        raise BvhError(f"{path}: motion values not finite or beyond 1e6")

    root = np.tile(np.array(offsets[0], dtype=np.float64), (frames, 1))
    local = np.tile(np.eye(3), (frames, len(names), 1, 1))
    column = 0
    for j, joint_channels in enumerate(channels):
        for channel in joint_channels:
            value, axis = data[:, column], channel[0]
            if channel.endswith("rotation"):
                local[:, j] = local[:, j] @ rotations.about_axis(axis, np.radians(value))
            elif j == 0:
                root[:, "XYZ".index(axis)] = value
            column += 1
    return BvhClip(names, np.array(parents), np.array(offsets), root, local, frame_seconds)


def read_motion(path):
    """Read a recorded clip of 15 joints and bring it onto the figure -> skeleton.Motion (30 frames/s)."""
    clip = read(path)
    if tuple(clip.names) != retarget.NAMES:
        raise BvhError(f"{path}: joints {clip.names}, expected {list(retarget.NAMES)}")
    apart = np.abs(clip.offsets - retarget.OFFSETS).max()
    if apart > 1e-3:
        raise BvhError(f"{path}: bone offsets differ from those of recorded clips by {apart:.4f} m, allowed 0.001")
    if abs(clip.frame_seconds * skeleton.FPS - 1) > 1e-3:
        raise BvhError(f"{path}: {1 / clip.frame_seconds:.2f} frames/s, expected {skeleton.FPS}")
    return retarget.onto_figure(clip.root, clip.local)
