"""Archives damaged at random, by what zip files are made of: names, attributes, headers, sizes, bytes."""

from __future__ import annotations

import io
import random
import struct
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

Entries = list[tuple[zipfile.ZipInfo, bytes]]
_FIXED_DATE = (1980, 1, 1, 0, 0, 0)
_LOCAL, _CENTRAL, _END = b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"
_LINK = 0o120777 << 16

NAMES = (
    *(
        "../evil.txt",
        "a/../../evil.txt",
        "/evil.txt",
        "//evil.txt",
        "C:\\evil.txt",
        "C:evil.txt",
        "..\\evil.txt",
    ),
    *("binaries/../../evil.txt", "./a.txt", "a//b.txt", "", "/", ".", "..", "a/.", "~/evil.txt", "con.txt"),
    *("\u00e4\u00f6.txt", "\u202etxt.exe", "a\nb", "a\x1b[2Jb", "a\x00b", "nul", "x" * 300, "a/" * 400 + "b"),
    *("modelDescription.xml/", "modelDescription.xml/a", "resources", "resources/a/b", "sources/all.c/x"),
    *(
        "MODELDESCRIPTION.XML",
        "modelDescription.xml",
        "a.txt:stream",
        " ",
        "a ",
        "a.",
        "-rf",
        "$(touch evil)",
    ),
)


def content_of(path: Path) -> dict[str, bytes]:
    """Return the entries of a sound archive by name."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def entries_of(content: Mapping[str, bytes]) -> Entries:
    """Return entries as the builder writes them."""
    return [(zipfile.ZipInfo(name, _FIXED_DATE), data) for name, data in content.items()]


def packed(entries: Entries) -> bytes:
    """Return the bytes of an archive."""
    target = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that are there twice
        with zipfile.ZipFile(target, "w") as archive:
            for info, data in entries:
                archive.writestr(info, data)
    return target.getvalue()


def _another(draw: random.Random, name: str, data: bytes) -> tuple[zipfile.ZipInfo, bytes]:
    info = zipfile.ZipInfo("placeholder", _FIXED_DATE)
    info.filename = name
    info.compress_type = draw.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA))
    return info, data


def _odd_name(entries: Entries, draw: random.Random) -> None:
    entries.insert(draw.randrange(len(entries) + 1), _another(draw, draw.choice(NAMES), draw.randbytes(9)))


def _renamed(entries: Entries, draw: random.Random) -> None:
    at = draw.randrange(len(entries))
    entries[at] = _another(draw, draw.choice(NAMES), entries[at][1])


def _link(entries: Entries, draw: random.Random) -> None:
    name = draw.choice(("resources", "link", "modelDescription.xml", "binaries", "sources"))
    target = draw.choice((b"/etc", b"..", b"../..", b"/", b"modelDescription.xml", b"link"))
    info, data = _another(draw, name, target)
    info.create_system, info.external_attr = 3, _LINK
    entries.insert(0, (info, data))
    entries.append(_another(draw, f"{name}/evil.txt", b"through a link"))


def _twice(entries: Entries, draw: random.Random) -> None:
    info, data = draw.choice(entries)
    entries.append(_another(draw, info.filename, data[: draw.randrange(len(data) + 1)]))


def _lost(entries: Entries, draw: random.Random) -> None:
    if len(entries) > 1:
        del entries[draw.randrange(len(entries))]


def _bomb(entries: Entries, draw: random.Random) -> None:
    if draw.random() < 0.05:  # it takes a while to make one
        info, data = _another(draw, "resources/zeros", bytes(60 << 20))
        info.compress_type = zipfile.ZIP_DEFLATED
        entries.append((info, data))


def _odd_attributes(entries: Entries, draw: random.Random) -> None:
    at = draw.randrange(len(entries))
    info, data = _another(draw, entries[at][0].filename, entries[at][1])
    info.external_attr = draw.getrandbits(32)
    info.create_system = draw.getrandbits(8)
    info.comment, info.extra = draw.randbytes(draw.randrange(9)), draw.randbytes(draw.randrange(9))
    entries[at] = info, data


SHAPES: tuple[Callable[[Entries, random.Random], None], ...] = (
    _odd_name, _odd_name, _renamed, _link, _twice, _lost, _bomb, _odd_attributes,
)  # fmt: skip


def _places(content: bytes, mark: bytes) -> list[int]:
    found, at = [], content.find(mark)
    while at >= 0:
        found.append(at)
        at = content.find(mark, at + 1)
    return found


def _odd_field(content: bytearray, draw: random.Random) -> None:
    """Write nonsense into one field of a header: flags, method, checksum, sizes, offsets, counts."""
    fields = {
        _LOCAL: ((6, "H"), (8, "H"), (14, "I"), (18, "I"), (22, "I"), (26, "H"), (28, "H")),
        _CENTRAL: (
            *((8, "H"), (10, "H"), (16, "I"), (20, "I"), (24, "I")),
            *((28, "H"), (30, "H"), (38, "I"), (42, "I")),
        ),
        _END: ((4, "H"), (8, "H"), (10, "H"), (12, "I"), (16, "I"), (20, "H")),
    }  # fmt: skip
    mark = draw.choice(tuple(fields))
    where = _places(content, mark)
    if where:
        offset, kind = draw.choice(fields[mark])
        at = draw.choice(where) + offset
        largest = 0xFFFF if kind == "H" else 0xFFFFFFFF
        value = draw.choice((0, 1, 8, 99, 0x800, 0x801, largest - 1, largest, draw.getrandbits(15)))
        if at + struct.calcsize(kind) <= len(content):
            struct.pack_into("<" + kind, content, at, value)


def _flipped(content: bytearray, draw: random.Random) -> None:
    for _ in range(draw.randint(1, 8)):
        content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)


def _cut(content: bytearray, draw: random.Random) -> None:
    del content[draw.randrange(len(content)) :]


def _inserted(content: bytearray, draw: random.Random) -> None:
    at = draw.randrange(len(content))
    content[at:at] = draw.randbytes(draw.randrange(1, 70))


def _swapped(content: bytearray, draw: random.Random) -> None:
    size = draw.randrange(1, 200)
    one, other = (draw.randrange(len(content)) for _ in range(2))
    content[one : one + size] = content[other : other + size]


BYTES: tuple[Callable[[bytearray, random.Random], None], ...] = (
    _odd_field, _odd_field, _odd_field, _flipped, _cut, _inserted, _swapped,
)  # fmt: skip


def damaged(content: Mapping[str, bytes], draw: random.Random) -> bytes:
    """Return an archive of these entries with some damage, in its shape, in its bytes or in both."""
    entries = entries_of(content)
    how = draw.random()
    for _ in range(draw.randint(1, 4) if how < 0.7 else 0):
        draw.choice(SHAPES)(entries, draw)
    result = bytearray(packed(entries))
    for _ in range(draw.randint(1, 3) if how > 0.4 else 0):
        if result:
            draw.choice(BYTES)(result, draw)
    return bytes(result)
