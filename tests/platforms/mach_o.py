"""Mach-O and its code signature, read from Apple's headers by themselves: no line of the package is used.

loader.h, fat.h; cs_blobs.h for the signature, which is big-endian.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator

CODE_SIGNATURE, ID_DYLIB, SEGMENT = 0x1D, 0xD, 0x19
CODE_DIRECTORY, SUPER_BLOB, CODE_DIRECTORY_BLOB = 0, 0xFADE0CC0, 0xFADE0C02
ADHOC, SHA256 = 0x2, 2


def slices(content: bytes) -> dict[int, tuple[int, int, bytes]]:
    """Return processor -> (offset, alignment, library) of a universal file."""
    magic, count = struct.unpack_from(">II", content)
    assert magic == 0xCAFEBABE
    found = {}
    for k in range(count):
        processor, _, offset, size, align = struct.unpack_from(">IIIII", content, 8 + 20 * k)
        assert offset % (1 << align) == 0
        assert offset + size <= len(content)
        found[processor] = (offset, 1 << align, content[offset : offset + size])
    return found


def load_commands(library: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield (kind, offset, size)."""
    assert struct.unpack_from("<I", library)[0] == 0xFEEDFACF
    count, at = struct.unpack_from("<I", library, 16)[0], 32
    for _ in range(count):
        kind, size = struct.unpack_from("<II", library, at)
        yield kind, at, size
        at += size


def install_name(library: bytes) -> str:
    """Return what a program that links the library remembers of it."""
    at = next(at for kind, at, _ in load_commands(library) if kind == ID_DYLIB)
    start = at + struct.unpack_from("<I", library, at + 8)[0]
    return library[start : library.index(b"\0", start)].decode()


def signature_complaints(library: bytes) -> list[str]:
    """Return what is wrong with an ad-hoc signature; nothing where every page has its hash."""
    places = [at for kind, at, _ in load_commands(library) if kind == CODE_SIGNATURE]
    if len(places) != 1:
        return [f"{len(places)} signatures"]
    start, size = struct.unpack_from("<II", library, places[0] + 8)
    complaints = [] if start % 16 == 0 and start + size == len(library) else ["not at the end of the file"]
    magic, length, count = struct.unpack_from(">III", library, start)
    index = [struct.unpack_from(">II", library, start + 12 + 8 * k) for k in range(count)]
    at = start + dict(index).get(CODE_DIRECTORY, 0)
    if magic != SUPER_BLOB or length > size or at == start:
        return [*complaints, "no code directory"]
    return complaints + _directory_complaints(library, start, at)


def _directory_complaints(library: bytes, start: int, at: int) -> list[str]:
    magic, _, version, flags, hashes, name, _, pages, limit = struct.unpack_from(">9I", library, at)
    hash_size, hash_type, _, page_bits = struct.unpack_from(">4B", library, at + 36)
    page = 1 << page_bits
    complaints = []
    if magic != CODE_DIRECTORY_BLOB or version < 0x20400:
        complaints.append("another code directory than is known")
    if not flags & ADHOC:
        complaints.append("not an ad-hoc signature")
    if (hash_size, hash_type) != (32, SHA256) or page_bits not in (12, 14):
        complaints.append("hashes of another kind")
    if limit != start or pages != -(-limit // page):
        complaints.append("does not cover all before the signature")
    if not library[at + name : library.index(b"\0", at + name)]:
        complaints.append("no identifier")
    for k in range(pages):
        content = library[k * page : min((k + 1) * page, limit)]
        if hashlib.sha256(content).digest() != library[at + hashes + 32 * k : at + hashes + 32 * (k + 1)]:
            complaints.append(f"page {k} has another hash")
    # Where there is an entry for it, the executable segment is the one called __TEXT.
    if version >= 0x20400:
        base, reach, _ = struct.unpack_from(">QQQ", library, at + 64)
        text = [
            struct.unpack_from("<QQQQ", library, place + 24)
            for kind, place, _ in load_commands(library)
            if kind == SEGMENT and library[place + 8 : place + 24].rstrip(b"\0") == b"__TEXT"
        ]
        if [(base, reach)] != [(offset, size) for _, _, offset, size in text]:
            complaints.append("the executable segment is another one")
    return complaints
