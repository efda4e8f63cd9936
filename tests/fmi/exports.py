"""Symbols of shared libraries, read from the files themselves: no tool of the machine is needed."""

from __future__ import annotations

import struct


def _text(content: bytes, start: int) -> str:
    return content[start : content.index(b"\0", start)].decode()


def elf_symbols(content: bytes) -> tuple[set[str], set[str]]:
    """Return (defined and visible, undefined) dynamic symbols of a 64-bit little-endian ELF library."""
    assert content[:6] == b"\x7fELF\x02\x01"
    (table,) = struct.unpack_from("<Q", content, 40)
    size, count = struct.unpack_from("<HH", content, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", content, table + k * size) for k in range(count)]
    defined, undefined = set(), set()
    for section in sections:
        if section[1] != 11:  # SHT_DYNSYM
            continue
        names = sections[section[6]][4]
        for at in range(section[4] + 24, section[4] + section[5], 24):
            name, _, other, index = struct.unpack_from("<IBBH", content, at)
            if index == 0:
                undefined.add(_text(content, names + name))
            elif other & 3 == 0:
                defined.add(_text(content, names + name))
    return defined, undefined


def elf_needs_libraries(content: bytes) -> bool:
    """Whether a 64-bit ELF library asks the loader for any other one (DT_NEEDED)."""
    (table,) = struct.unpack_from("<Q", content, 32)
    size, count = struct.unpack_from("<HH", content, 54)
    for k in range(count):
        kind, _, offset, _, _, length = struct.unpack_from("<IIQQQQ", content, table + k * size)
        if kind == 2:  # PT_DYNAMIC
            tags = [struct.unpack_from("<q", content, at)[0] for at in range(offset, offset + length, 16)]
            return 1 in tags[: tags.index(0)]
    raise AssertionError("no dynamic section")


def pe_symbols(content: bytes) -> tuple[set[str], set[str]]:
    """Return (exported names, imported libraries) of a 64-bit Windows library."""
    (header,) = struct.unpack_from("<I", content, 0x3C)
    assert content[header : header + 4] == b"PE\0\0"
    sections, optional = (struct.unpack_from("<H", content, header + at)[0] for at in (6, 20))
    first = header + 24 + optional
    rows = [struct.unpack_from("<8sIIII", content, first + 40 * k) for k in range(sections)]

    def place(address: int) -> int:
        row = next(r for r in rows if r[2] <= address < r[2] + max(r[1], r[3]))
        return address - row[2] + row[4]

    export, _, imports, _ = struct.unpack_from("<IIII", content, header + 24 + 112)
    count, _, names = struct.unpack_from("<III", content, place(export) + 24)
    exported = {
        _text(content, place(struct.unpack_from("<I", content, place(names) + 4 * k)[0]))
        for k in range(count)
    }
    libraries = set()
    at = place(imports)
    while any(content[at : at + 20]):
        libraries.add(_text(content, place(struct.unpack_from("<I", content, at + 12)[0])))
        at += 20
    return exported, libraries
