"""The zip archive of an FMU: whether it can be unpacked anywhere, and unpacking it without trusting it."""

from __future__ import annotations

import stat
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from fmu_builder.check.finding import Finding, Severity, practice, standard

DESCRIPTION = "modelDescription.xml"
LARGEST_UNPACKED = 4 << 30
"""Size in bytes of all entries together above which an archive is not unpacked."""

MOST_ENTRIES = 100_000
_LARGEST_RATIO = 200
_RATIO_MATTERS = 50 << 20
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 0x1
_UTF8 = 0x800
_CHUNK = 1 << 20
_WINDOWS_DEVICES = {"con", "prn", "aux", "nul", *(f"{d}{n}" for d in ("com", "lpt") for n in range(1, 10))}
_WINDOWS_LETTERS = set('<>"|?*')
_LEFTOVERS = (".pdb", ".lib", ".exp", ".ilk", ".obj", ".o", ".pyc", ".ds_store", "thumbs.db")
_READING_FAILS = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    NotImplementedError,
    RuntimeError,
    ValueError,
    OSError,
)
_DISTRIBUTION = standard("2.3")
_EXPORT_AGAIN = "Export it again with entries as plain relative paths with forward slashes"


def _is_unsafe(name: str) -> str | None:
    """Return why unpacking an entry could write outside the target folder, or None."""
    if "\\" in name:
        return "has a backslash, a folder mark on Windows and a letter elsewhere"
    if name.startswith("/"):
        return "is an absolute path"
    if ":" in name:
        return "has a colon: a drive or a stream on Windows"
    if ".." in name.split("/"):
        return "climbs out of its folder with '..'"
    if any(ord(letter) < 32 or ord(letter) == 127 for letter in name):
        return "has control characters"
    return None


def _name_trouble(name: str) -> str | None:
    """Return what is wrong with a harmless name, or None."""
    parts = name.rstrip("/").split("/")
    if "." in parts or "" in parts:
        return "has './' or an empty part; some importers then do not find the entry"
    if any(part.split(".")[0].lower() in _WINDOWS_DEVICES or part[-1] in ". " for part in parts):
        return "cannot be a file name on Windows"
    if set(name) & _WINDOWS_LETTERS:
        return "has letters that a file name cannot have on Windows"
    return None


def _entry_findings(entry: zipfile.ZipInfo) -> Iterator[Finding]:
    # zipfile cuts names at a zero byte and turns the separator of the running system into "/"
    name = entry.orig_filename
    place = f"archive, entry {name!r}"
    if reason := _is_unsafe(name):
        yield Finding(Severity.ERROR, "archive-path", place, reason, _DISTRIBUTION, _EXPORT_AGAIN)
    elif reason := _name_trouble(name):
        yield Finding(Severity.WARNING, "archive-name", place, reason, practice("Windows"), _EXPORT_AGAIN)
    if not name.isascii() and not entry.flag_bits & _UTF8:
        what = "has letters beyond ASCII in an unknown encoding"
        yield Finding(
            Severity.WARNING, "archive-encoding", place, what, practice("zip"), "Mark the name as UTF-8"
        )
    if stat.S_ISLNK(entry.external_attr >> 16):
        mend = "Export the file itself"
        yield Finding(Severity.ERROR, "archive-link", place, "is a symbolic link", _DISTRIBUTION, mend)
    if entry.flag_bits & _ENCRYPTED:
        yield Finding(
            Severity.ERROR, "archive-encrypted", place, "is encrypted", _DISTRIBUTION, "Do not encrypt"
        )
    if entry.compress_type not in _METHODS:
        what = f"uses the compression method {entry.compress_type}, which most importers cannot read"
        mend = "Store or deflate every entry"
        yield Finding(Severity.ERROR, "archive-method", place, what, _DISTRIBUTION, mend)
    if name.lower().endswith(_LEFTOVERS) and not name.startswith("resources/"):
        what = "is a by-product of a compiler or of a desktop, no part of an FMU"
        yield Finding(Severity.NOTE, "archive-leftover", place, what, _DISTRIBUTION, "Leave it out")


def _bomb_findings(path: Path, entries: list[zipfile.ZipInfo]) -> Iterator[Finding]:
    unpacked = sum(entry.file_size for entry in entries)
    packed = sum(entry.compress_size for entry in entries)
    mend = "Do not use this file; ask its author for a clean export"
    if len(entries) > MOST_ENTRIES or unpacked > LARGEST_UNPACKED:
        what = f"unpacks to {len(entries)} entries with {unpacked >> 20} MiB; nothing was unpacked"
        yield Finding(Severity.ERROR, "archive-bomb", "archive", what, practice("safety"), mend)
    elif unpacked > _RATIO_MATTERS and unpacked > _LARGEST_RATIO * max(packed, 1):
        what = f"unpacks to {unpacked // max(packed, 1)} times its size; nothing was unpacked"
        yield Finding(Severity.ERROR, "archive-bomb", "archive", what, practice("safety"), mend)
    if packed > path.stat().st_size:
        what = "has entries that overlap: together they are larger than the file"
        yield Finding(Severity.ERROR, "archive-bomb", "archive", what, practice("safety"), mend)


def _duplicate_findings(names: list[str]) -> Iterator[Finding]:
    for name, count in Counter(names).items():
        if count > 1:
            what = f"is there {count} times; importers disagree which one counts"
            yield Finding(
                Severity.ERROR, "archive-duplicate", f"archive, entry {name!r}", what, _DISTRIBUTION,
                "Write every entry once",
            )  # fmt: skip
    for _, count in Counter(name.lower() for name in set(names)).items():
        if count > 1:
            what = "has names that differ in upper and lower case only, one file on Windows and macOS"
            yield Finding(
                Severity.WARNING, "archive-case", "archive", what, practice("Windows"), "Rename one"
            )
            return


def _layout_findings(names: list[str]) -> Iterator[Finding]:
    if DESCRIPTION in names:
        return
    inner = next((name for name in names if name.endswith("/" + DESCRIPTION)), None)
    what = f"has no {DESCRIPTION} at its root" + (f", but {inner!r}" if inner else "")
    yield Finding(
        Severity.ERROR, "archive-layout", "archive", what, _DISTRIBUTION,
        "Zip the contents of the FMU's folder, not the folder",
    )  # fmt: skip


def inspect_archive(path: Path) -> list[Finding]:
    """Return everything that is wrong with the archive, without unpacking it.

    Args:
        path: The FMU file.
    """
    if not path.is_file():
        mend = "Give the path of an existing .fmu file"
        what = "there is no such FMU file"
        return [Finding(Severity.ERROR, "archive", "archive", what, _DISTRIBUTION, mend)]
    findings: list[Finding] = []
    if path.suffix != ".fmu":
        what = f"ends with {path.suffix!r}, not with '.fmu'"
        findings.append(
            Finding(Severity.WARNING, "archive-suffix", "archive", what, _DISTRIBUTION, "Rename it")
        )
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
    except _READING_FAILS as reason:
        what = f"is not a readable FMU archive ({reason})"
        mend = "Copy or export the file again; it may be cut short"
        return [*findings, Finding(Severity.ERROR, "archive", "archive", what, _DISTRIBUTION, mend)]
    names = [entry.orig_filename for entry in entries]
    findings.extend(_bomb_findings(path, entries))
    if len(entries) <= MOST_ENTRIES:
        findings.extend(finding for entry in entries for finding in _entry_findings(entry))
        findings.extend(_duplicate_findings(names))
    findings.extend(_layout_findings(names))
    return findings


def _write_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path) -> None:
    """Copy one entry in pieces, never more than its header announces."""
    target.parent.mkdir(parents=True, exist_ok=True)
    left = entry.file_size
    with archive.open(entry) as source, target.open("wb") as sink:
        while left >= 0 and (piece := source.read(_CHUNK)):
            left -= len(piece)
            sink.write(piece)
    if left < 0:
        raise zipfile.BadZipFile("the entry is longer than its header says")


def unpack(path: Path, folder: Path) -> list[Finding]:
    """Unpack the harmless entries of an archive that `inspect_archive` has seen.

    Nothing is written outside `folder`: links, unsafe names and archives that are too large stay packed.

    Args:
        path: The FMU file.
        folder: An existing, empty folder.

    Returns:
        A finding per entry that cannot be read.
    """
    findings = []
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if any(_bomb_findings(path, entries)):
            return []
        for entry in entries:
            name = entry.filename
            unsafe = _is_unsafe(entry.orig_filename) or stat.S_ISLNK(entry.external_attr >> 16)
            if unsafe or not PurePosixPath(name).parts or entry.is_dir():  # is_dir needs a name
                continue
            try:
                _write_entry(archive, entry, folder / PurePosixPath(name))
            except _READING_FAILS as reason:
                place, mend = f"archive, entry {name!r}", "Copy or export the file again"
                what = f"is damaged ({type(reason).__name__}: {reason})"
                findings.append(Finding(Severity.ERROR, "archive-damaged", place, what, _DISTRIBUTION, mend))
    return findings
