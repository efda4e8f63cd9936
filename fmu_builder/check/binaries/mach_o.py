"""Libraries of macOS: Mach-O, alone or several in one universal file (Apple's loader.h, fat.h, nlist.h)."""

from __future__ import annotations

from fmu_builder.check.binaries.binary import Binary
from fmu_builder.check.binaries.bytes_view import BinaryError, rows, text, unpack

_MACHINES = {7: "x86", 0x01000007: "x86_64", 0x0100000C: "aarch64"}
_UNIVERSAL = b"\xca\xfe\xba\xbe"
_THIN = {b"\xcf\xfa\xed\xfe": 32, b"\xce\xfa\xed\xfe": 28}  # magic -> size of the header
_LIBRARY_KINDS = (6, 8)  # dynamic library, bundle
_SYMTAB, _ID_DYLIB, _CODE_SIGNATURE = 0x2, 0xD, 0x1D
_LOADS = (0xC, 0x80000018, 0x8000001F, 0x80000023)  # load, weak, re-export, upward
_EXTERNAL, _PRIVATE, _DEBUG, _KIND = 0x01, 0x10, 0xE0, 0x0E
_MOST_PROCESSORS = 20
_MADE_BY_LINKER = ("_mh_", "__dso_handle")  # marks of the image itself, in every library


def _symbols(content: bytes, at: int, wide: bool) -> tuple[frozenset[str], frozenset[str]]:
    """Return (defined, undefined) external symbols without the leading underscore of C."""
    offset, count, strings, _ = unpack("<IIII", content, at + 8)
    defined: set[str] = set()
    undefined: set[str] = set()
    for name_at, kind, *_ in rows("<IBBHQ" if wide else "<IBBHI", content, offset, count):
        if kind & _DEBUG or not kind & _EXTERNAL or kind & _PRIVATE:
            continue
        name = text(content, strings + name_at).removeprefix("_")
        if name.startswith(_MADE_BY_LINKER):
            continue
        (defined if kind & _KIND else undefined).add(name)
    return frozenset(defined), frozenset(undefined)


def _read_one(content: bytes) -> Binary:
    size = _THIN.get(content[:4])
    if size is None:
        raise BinaryError("holds something that is no Mach-O library")
    machine, _, kind, count, _ = unpack("<IIIII", content, 4)
    if kind not in _LIBRARY_KINDS:
        raise BinaryError("is a Mach-O file, but no library")
    exported: frozenset[str] = frozenset()
    needed: frozenset[str] = frozenset()
    libraries: list[str] = []
    remarks = {"unsigned": "yes"}
    at = size
    for _ in range(min(count, 10_000)):
        command, length = unpack("<II", content, at)
        if length < 8:
            raise BinaryError("a load command is damaged")
        if command == _SYMTAB:
            exported, needed = _symbols(content, at, wide=size == 32)
        elif command == _CODE_SIGNATURE:
            remarks.pop("unsigned", None)
        elif command == _ID_DYLIB:
            remarks["install name"] = text(content, at + unpack("<I", content, at + 8)[0])
        elif command in _LOADS:
            libraries.append(text(content, at + unpack("<I", content, at + 8)[0]))
        at += length
    name = _MACHINES.get(machine, f"Mach-O processor {machine:#x}")
    return Binary("Mach-O", name, exported, needed, tuple(libraries), remarks=remarks)


def read(content: bytes) -> list[Binary]:
    """Return the library for each processor, nothing when the bytes are no Mach-O file.

    Raises:
        BinaryError: The tables are damaged, or it is no library.
    """
    if content[:4] in _THIN:
        return [_read_one(content)]
    if content[:4] != _UNIVERSAL:
        return []
    (count,) = unpack(">I", content, 4)
    if count > _MOST_PROCESSORS:
        raise BinaryError("claims to hold code for too many processors")
    slices = rows(">IIIII", content, 8, count)
    return [_read_one(content[offset : offset + size]) for _, _, offset, size, _ in slices]
