"""ELF, as the dynamic loader of Linux reads it (System V ABI, chapters 4 and 5; LSB symbol versions)."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from fmu_builder.check.binaries.binary import Binary
from fmu_builder.check.binaries.bytes_view import BinaryError, rows, text, unpack

_MACHINES = {3: "x86", 62: "x86_64", 183: "aarch64"}
_SHARED = 3
_LOAD, _DYNAMIC, _GNU_STACK = 1, 2, 0x6474E551
_EXECUTABLE = 1
_NEEDED, _HASH, _STRTAB, _SYMTAB, _GNU_HASH = 1, 4, 5, 6, 0x6FFFFEF5
_VERSYM, _VERNEED, _VERNEEDNUM = 0x6FFFFFF0, 0x6FFFFFFE, 0x6FFFFFFF
_GLOBAL, _WEAK = 1, 2
_HIDDEN = (1, 2)
_SECTION_SYMBOLS = 2


@dataclass(frozen=True)
class _Layout:
    """Struct layouts of one class of ELF, with the columns put in one order."""

    header: str
    segment: str
    segment_order: tuple[int, ...]  # type, flags, offset, address, size in file
    dynamic: str
    symbol: str
    symbol_order: tuple[int, ...]  # name, info, other, section
    section: str


_NARROW = _Layout(
    "<HHIIIIIHHHHHH", "<IIIIIIII", (0, 6, 1, 2, 4), "<iI", "<IIIBBH", (0, 3, 4, 5), "<IIIIIIIIII"
)
_WIDE = _Layout("<HHIQQQIHHHHHH", "<IIQQQQQQ", (0, 1, 2, 3, 5), "<qQ", "<IBBHQQ", (0, 1, 2, 3), "<IIQQQQIIQQ")


def _layout(content: bytes) -> _Layout:
    if content[5:6] != b"\x01":
        raise BinaryError("is an ELF library of a big-endian processor")
    return _WIDE if content[4:5] == b"\x02" else _NARROW


class _Image:
    """The segments of a file and the tables that its dynamic section names."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.layout = _layout(content)
        kind, machine, _, _, segments, _, _, _, size, count, *_ = unpack(self.layout.header, content, 16)
        if kind != _SHARED:
            raise BinaryError("is an ELF file, but no shared library")
        self.machine = _MACHINES.get(machine, f"ELF machine {machine}")
        raw = (unpack(self.layout.segment, content, segments + k * size) for k in range(count))
        self.segments = [tuple(row[k] for k in self.layout.segment_order) for row in raw]
        self.dynamic = self._dynamic()

    def _dynamic(self) -> list[tuple[int, int]]:
        for kind, _, offset, _, size in self.segments:
            if kind == _DYNAMIC:
                width = 16 if self.layout is _WIDE else 8
                found = []
                for tag, value in rows(self.layout.dynamic, self.content, offset, size // width):
                    if tag == 0:
                        break
                    found.append((tag & 0xFFFFFFFF, value))
                return found
        raise BinaryError("has no dynamic section")

    def place(self, tag: int) -> int | None:
        """Return the file offset of a table of the dynamic section."""
        address = next((value for found, value in self.dynamic if found == tag), None)
        if address is None:
            return None
        for kind, _, offset, start, size in self.segments:
            if kind == _LOAD and start <= address < start + size:
                return address - start + offset
        raise BinaryError("the dynamic section points outside the file")

    def value(self, tag: int) -> int:
        return next((value for found, value in self.dynamic if found == tag), 0)

    def symbol_count(self) -> int:
        """Return the number of dynamic symbols, which only the hash tables know."""
        if (at := self.place(_HASH)) is not None:
            return unpack("<II", self.content, at)[1]
        if (at := self.place(_GNU_HASH)) is None:
            return 0
        buckets, first, bloom, _ = unpack("<IIII", self.content, at)
        at += 16 + bloom * (8 if self.layout is _WIDE else 4)
        last = max((row[0] for row in rows("<I", self.content, at, buckets)), default=0)
        if last < first:
            return first
        chain = at + buckets * 4 + (last - first) * 4
        while not unpack("<I", self.content, chain)[0] & 1:
            last, chain = last + 1, chain + 4
        return last + 1


def _version_names(image: _Image, strings: int) -> dict[int, str]:
    """Return the names of the symbol versions that the file needs, by their number."""
    names: dict[int, str] = {}
    at = image.place(_VERNEED)
    for _ in range(min(image.value(_VERNEEDNUM), 1000) if at is not None else 0):
        _, count, _, auxiliary, following = unpack("<HHIII", image.content, at or 0)
        entry = (at or 0) + auxiliary
        for _ in range(count):
            _, _, number, name, step = unpack("<IHHII", image.content, entry)
            names[number & 0x7FFF] = text(image.content, strings + name)
            entry += step
        at = (at or 0) + following
    return names


def read(content: bytes) -> list[Binary]:
    """Return the library, nothing when the bytes are no ELF file.

    Raises:
        BinaryError: The tables are damaged, or it is no shared library.
    """
    if content[:4] != b"\x7fELF":
        return []
    image = _Image(content)
    strings, symbols = image.place(_STRTAB), image.place(_SYMTAB)
    if strings is None or symbols is None:
        raise BinaryError("has no dynamic symbols")
    names = _version_names(image, strings)
    numbers = image.place(_VERSYM)
    exported, needed = set(), set()
    versions: dict[str, list[str]] = defaultdict(list)
    for k, row in enumerate(rows(image.layout.symbol, content, symbols, image.symbol_count())):
        name_at, info, other, section = (row[column] for column in image.layout.symbol_order)
        if info >> 4 not in (_GLOBAL, _WEAK):
            continue
        name = text(content, strings + name_at)
        if section == 0 and info >> 4 == _GLOBAL:
            needed.add(name)
            number = unpack("<H", content, numbers + 2 * k)[0] & 0x7FFF if numbers is not None else 0
            if number in names:
                versions[names[number]].append(name)
        elif section != 0 and other & 3 not in _HIDDEN:
            exported.add(name)
    stack = [flags for kind, flags, *_ in image.segments if kind == _GNU_STACK]
    remarks = {"executable stack": "yes"} if any(flags & _EXECUTABLE for flags in stack) else {}
    libraries = [text(content, strings + value) for tag, value in image.dynamic if tag == _NEEDED]
    return [
        Binary(
            format="ELF",
            machine=image.machine,
            exported=frozenset(exported),
            needed=frozenset(needed),
            libraries=tuple(libraries),
            versions={name: tuple(sorted(found)) for name, found in sorted(versions.items())},
            remarks=remarks,
        )
    ]


def object_symbols(content: bytes) -> tuple[set[str], set[str]]:
    """Return (defined, undefined) global symbols of an object file; weak ones, which may be there twice, not.

    Raises:
        BinaryError: The file is no ELF object, or damaged.
    """
    if content[:4] != b"\x7fELF":
        raise BinaryError("is no ELF object")
    layout = _layout(content)
    header = unpack(layout.header, content, 16)
    table, count = header[5], header[11]
    sections = list(rows(layout.section, content, table, count))
    defined: set[str] = set()
    undefined: set[str] = set()
    for section in sections:
        if section[1] != _SECTION_SYMBOLS:
            continue
        offset, size, link, width = section[4], section[5], section[6], section[9]
        if width == 0 or link >= len(sections):
            raise BinaryError("the symbol table is damaged")
        for row in rows(layout.symbol, content, offset, size // width):
            name_at, info, _, index = (row[column] for column in layout.symbol_order)
            if info >> 4 == _GLOBAL:
                (undefined if index == 0 else defined).add(text(content, sections[link][4] + name_at))
    return defined, undefined
