"""Read HDF5 files that are open, damaged, or not closed because the program was killed.

The HDF5 library opens such files only in SWMR mode, in which it retries damaged data for minutes to
years. This module passes it a header marked as closed (HDF5 File Format 3.0, II.A, VII.B).
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HEAD = struct.Struct("<8sBBBB4Q")  # signature, version, sizes, flags and addresses: 44 bytes
_NEW = (2, 3)  # versions that have such a header
_MASK = 0xFFFFFFFF


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """Open a file for reading, with the content that it has now.

    Raises OSError if it is not HDF5, or is truncated or damaged.
    """
    import h5py

    with path.open("rb", buffering=0) as raw, h5py.File(_Closed(raw), "r") as root:
        yield root


class _Closed(io.RawIOBase):
    def __init__(self, raw: io.RawIOBase):
        self._raw = raw
        self._size = raw.seek(0, os.SEEK_END)
        raw.seek(0)
        self._head = _closed(raw.read(_HEAD.size + 4) or b"", self._size)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        if whence == os.SEEK_END:
            offset, whence = self._size + offset, os.SEEK_SET
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def readinto(self, buffer: Any) -> int:
        at = self._raw.tell()
        count = self._raw.readinto(buffer) or 0
        if at < len(self._head) and count:
            shown = self._head[at : at + count]
            memoryview(buffer).cast("B")[: len(shown)] = shown
        return count


def _closed(head: bytes, size: int) -> bytes:
    if len(head) < _HEAD.size + 4 or head[:8] != _SIGNATURE or head[8] not in _NEW:
        return head  # the HDF5 library reports the error
    signature, version, offsets, lengths, flags, base, extension, end, root = _HEAD.unpack_from(
        head
    )
    if head[_HEAD.size :] != struct.pack("<I", _checksum(head[: _HEAD.size])):
        return head
    if not flags:
        return head
    end = max(end, size)  # the HDF5 library reports a truncated file
    shown = _HEAD.pack(signature, version, offsets, lengths, 0, base, extension, end, root)
    return shown + struct.pack("<I", _checksum(shown))


def _checksum(data: bytes) -> int:
    """Return the checksum of HDF5: hashlittle of lookup3 (Jenkins 2006)."""

    def turned(x: int, k: int) -> int:
        return (x << k | x >> (32 - k)) & _MASK

    a = b = c = (0xDEADBEEF + len(data)) & _MASK
    padded = data + bytes(-len(data) % 12)
    words = struct.unpack(f"<{len(padded) // 4}I", padded)
    for k in range(0, len(words), 3):
        a, b, c = (a + words[k]) & _MASK, (b + words[k + 1]) & _MASK, (c + words[k + 2]) & _MASK
        if k + 3 < len(words):
            for shift in (4, 6, 8, 16, 19, 4):
                a = ((a - c) & _MASK) ^ turned(c, shift)
                c = (c + b) & _MASK
                a, b, c = b, c, a
        else:
            for shift in (14, 11, 25, 16, 4, 14, 24):
                c = ((c ^ b) - turned(b, shift)) & _MASK
                a, b, c = b, c, a
    return b
