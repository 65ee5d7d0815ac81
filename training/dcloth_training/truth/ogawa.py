"""Ogawa, the container of Alembic files since 2013: groups and byte strings by offset. Files are untrusted.

    "Ogawa", 0xff when complete, version u16 big-endian (1), offset u64 of the root group
    group: u64 count, then offsets u64; the top bit says byte string; 0 is an empty one
    byte string: u64 size, then bytes
"""
import mmap
import os
import struct

from .errors import refuse

DATA = 1 << 63
MAX_CHILDREN = 1 << 24


class Ogawa:
    def __init__(self, path):
        self.path = path
        self.size = os.path.getsize(path)
        if self.size < 16:
            refuse(path, f"{self.size} bytes", "an Alembic file")
        with open(path, "rb") as file:
            self.bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        if self.bytes[:8] == b"\x89HDF\r\n\x1a\n":
            refuse(path, "Alembic in an HDF5 container", "Alembic in an Ogawa container",
                   "export with Ogawa, the default since 2013")
        if self.bytes[:5] != b"Ogawa":
            refuse(path, f"{bytes(self.bytes[:5])!r}", "an Alembic file, which begins with Ogawa")
        if self.bytes[5] != 0xff or self.bytes[6:8] != b"\0\1":
            refuse(path, f"state {self.bytes[5]:#x}, version {bytes(self.bytes[6:8]).hex()}",
                   "a complete file (0xff) of version 0001", "the export was interrupted; write the file again")
        self.root = Group(self, struct.unpack("<Q", self.bytes[8:16])[0])

    def damaged(self, what):
        refuse(self.path, what, "offsets and sizes within the file", "the file is cut short or damaged; write it again")

    def span(self, offset, size):
        if offset > self.size or size > self.size - offset:
            self.damaged(f"{size} bytes at byte {offset} of {self.size}")
        return self.bytes[offset:offset + size]

    def number(self, offset):
        return struct.unpack("<Q", self.span(offset, 8))[0]


class Group:
    """Children are fetched when asked for: nothing follows a cycle by itself."""

    def __init__(self, file, offset):
        self.file, count = file, file.number(offset) if offset else 0
        if count > MAX_CHILDREN:
            file.damaged(f"a group of {count} children at byte {offset}")
        self.children = struct.unpack(f"<{count}Q", file.span(offset + 8, 8 * count)) if count else ()

    def __len__(self):
        return len(self.children)

    def _child(self, index, data):
        if not 0 <= index < len(self.children):
            self.file.damaged(f"no child {index} in a group of {len(self.children)}")
        child = self.children[index]
        if bool(child & DATA) != data:
            self.file.damaged(f"child {index} {'is not' if data else 'is'} a byte string")
        return child & ~DATA

    def group(self, index):
        return Group(self.file, self._child(index, False))

    def data(self, index):
        offset = self._child(index, True)
        return self.file.span(offset + 8, self.file.number(offset)) if offset else b""


class Words:
    """Little-endian numbers and texts one after another in a byte string."""

    def __init__(self, file, blob, what):
        self.file, self.blob, self.what, self.at = file, blob, what, 0

    def __bool__(self):
        return self.at < len(self.blob)

    def take(self, size):
        if size > len(self.blob) - self.at:
            self.file.damaged(f"{self.what} that end at byte {len(self.blob)} in the middle of an entry")
        self.at += size
        return self.blob[self.at - size:self.at]

    def unpack(self, code):
        return struct.unpack("<" + code, self.take(struct.calcsize("<" + code)))[0]

    def text(self, size):
        return self.take(size).decode("utf-8", "replace")
