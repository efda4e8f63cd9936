"""Windows libraries (Microsoft PE format: headers, export directory, import directory)."""

from __future__ import annotations

from fmu_builder.check.binaries.binary import Binary
from fmu_builder.check.binaries.bytes_view import BinaryError, rows, text, unpack

_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "aarch64"}
_IS_LIBRARY = 0x2000
_DIRECTORIES = {0x10B: 96, 0x20B: 112}  # where the directories begin in the optional header, by its kind
_MOST_LIBRARIES = 1000


class _Image:
    """The sections of a file, to turn addresses into offsets."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        (header,) = unpack("<I", content, 0x3C)
        if content[header : header + 4] != b"PE\0\0":
            raise BinaryError("begins like a Windows program but has no PE header")
        machine, count, _, _, _, optional, kind = unpack("<HHIIIHH", content, header + 4)
        if not kind & _IS_LIBRARY:
            raise BinaryError("is a Windows program, not a library")
        self.machine = _MACHINES.get(machine, f"PE machine {machine:#x}")
        start = header + 24
        (magic,) = unpack("<H", content, start)
        if magic not in _DIRECTORIES:
            raise BinaryError("has an unknown optional header")
        table = start + _DIRECTORIES[magic]
        self.export, _, self.imports, _ = unpack("<IIII", content, table)
        raw = rows("<QIIIIIIHHI", content, start + optional, count)
        self.sections = [(row[2], max(row[1], row[3]), row[4]) for row in raw]

    def place(self, address: int) -> int:
        for start, size, offset in self.sections:
            if start <= address < start + size:
                return address - start + offset
        raise BinaryError("a table points outside the file")

    def text(self, address: int) -> str:
        return text(self.content, self.place(address))


def _exported(image: _Image) -> frozenset[str]:
    if image.export == 0:
        return frozenset()
    count, _, names = unpack("<III", image.content, image.place(image.export) + 24)
    if count == 0:
        return frozenset()
    return frozenset(image.text(row[0]) for row in rows("<I", image.content, image.place(names), count))


def _libraries(image: _Image) -> tuple[str, ...]:
    found: list[str] = []
    at = image.place(image.imports) if image.imports else -1
    while at >= 0 and len(found) < _MOST_LIBRARIES:
        *_, name, _ = unpack("<IIIII", image.content, at)
        if name == 0:
            break
        found.append(image.text(name))
        at += 20
    return tuple(found)


def read(content: bytes) -> list[Binary]:
    """Return the library, nothing when the bytes are no PE file.

    Raises:
        BinaryError: The tables are damaged, or it is no library.
    """
    if content[:2] != b"MZ":
        return []
    image = _Image(content)
    return [Binary("PE", image.machine, _exported(image), libraries=_libraries(image))]
