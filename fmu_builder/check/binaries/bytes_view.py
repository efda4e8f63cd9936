"""Reading numbers and texts from bytes that may lie about themselves."""

from __future__ import annotations

import struct
from collections.abc import Iterator

LONGEST_TEXT = 4096
MOST_RECORDS = 1_000_000
"""No table of a sane library has more entries; a damaged one may claim to."""


class BinaryError(ValueError):
    """The bytes are no library of a known format, or contradict themselves."""


def unpack(layout: str, content: bytes, at: int) -> tuple[int, ...]:
    """Return the integers of a struct layout at an offset.

    Raises:
        BinaryError: They lie outside the file.
    """
    if not 0 <= at <= len(content) - struct.calcsize(layout):
        raise BinaryError("a table points outside the file")
    return struct.unpack_from(layout, content, at)


def text(content: bytes, at: int) -> str:
    """Return the zero-terminated text at an offset.

    Raises:
        BinaryError: It lies outside the file or has no end.
    """
    end = content.find(b"\0", at, at + LONGEST_TEXT) if 0 <= at < len(content) else -1
    if end < 0:
        raise BinaryError("a name points outside the file")
    return content[at:end].decode("utf-8", errors="replace")


def rows(layout: str, content: bytes, at: int, count: int) -> Iterator[tuple[int, ...]]:
    """Yield `count` packed records.

    Raises:
        BinaryError: They lie outside the file, or there are too many to believe.
    """
    size = struct.calcsize(layout)
    if count > MOST_RECORDS or at < 0 or at + count * size > len(content):
        raise BinaryError("a table is longer than the file")
    for k in range(count):
        yield unpack(layout, content, at + k * size)
