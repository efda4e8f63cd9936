"""Libraries of macOS for several processors in one file (Apple's mach-o/fat.h)."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from fmu_builder.errors import BuildError

_ALIGNMENT = {0x01000007: 12}
"""Slices begin at multiples of 2 to this power: pages of Intel's processors have 4 KiB."""
_LARGEST_ALIGNMENT = 14
"""Pages of Apple's own processors have 16 KiB."""

_MAGIC = 0xCAFEBABE
_SLICE_MAGIC = 0xFEEDFACF  # 64-bit Mach-O, least significant byte first
_HEADER, _SLICE_HEADER, _RECORD = ">II", "<III", ">IIIII"


def universal_library(slices: Sequence[bytes]) -> bytes:
    """Return one library of several for one processor each, in their order; same slices, same bytes.

    A slice keeps its bytes, so what signs it stays valid.

    Args:
        slices: 64-bit Mach-O libraries.

    Raises:
        BuildError: A slice is no such library, or two are for the same processor.
    """
    at = struct.calcsize(_HEADER) + len(slices) * struct.calcsize(_RECORD)
    records, body, processors = b"", b"", set()
    for content in slices:
        magic, processor, kind = struct.unpack_from(_SLICE_HEADER, content.ljust(12, b"\0"))
        if magic != _SLICE_MAGIC or processor in processors:
            what = "slices must be 64-bit Mach-O libraries of different processors"
            raise BuildError.of("universal library", what, "Compile each for its own platform")
        processors.add(processor)
        alignment = _ALIGNMENT.get(processor, _LARGEST_ALIGNMENT)
        start = -(-(at + len(body)) // (1 << alignment)) * (1 << alignment)
        records += struct.pack(_RECORD, processor, kind, start, len(content), alignment)
        body = body.ljust(start - at, b"\0") + content
    return struct.pack(_HEADER, _MAGIC, len(slices)) + records + body
