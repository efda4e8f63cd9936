"""Folders of results: an earlier run's may be replaced, anything else in a user's place may not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fmu_builder.errors import OutputError
from fmu_builder.files import folder_written_atomically, write_text

LISTING = "files.txt"
"""Names all other files of a result, one per line, after a line with the kind of result."""

_NAMED = 3
"""Files named in a refusal; of more, the number."""


@contextmanager
def result_folder(path: Path, kind: str) -> Iterator[Path]:
    """Yield a temporary folder that takes the place of `path` when the block ends without an error.

    Its listing (`LISTING`) tells what a later run may replace.

    Args:
        path: The folder of the results. An earlier result of this kind that stands there is replaced as a
            whole.
        kind: What kind of result it is, on one line.

    Raises:
        OutputError: `path` is a file, the working folder, a folder that no earlier run of this kind wrote, or
            one in which somebody has put files since; or it cannot be written.
    """
    _refuse_foreign(path, kind)
    with folder_written_atomically(path) as temporary:
        yield temporary
        write_text(temporary / LISTING, "\n".join([kind, *_files(temporary)]) + "\n")


def _refuse_foreign(path: Path, kind: str) -> None:
    mend = "Choose a folder that does not exist yet"
    try:
        whole, here = path.resolve(), Path.cwd()
        if here.is_relative_to(whole):
            raise OutputError.of(str(path), "is the working folder or one above it", mend)
        if path.is_dir():
            present, ours = _files(path), _listed(path / LISTING, kind)
            if present and not ours:
                what = f"holds files that no earlier run wrote (no {LISTING} of one), and would be replaced"
                raise OutputError.of(str(path), what, mend)
            if added := [name for name in present if name not in ours]:
                what = f"holds files that no earlier run wrote ({_some(added)}), and would be replaced"
                raise OutputError.of(str(path), what, "Move them, or choose another folder")
        elif path.exists():
            raise OutputError.of(str(path), "is a file, not a folder", mend)
    except OSError as reason:
        if isinstance(reason, OutputError):
            raise
        raise OutputError.of(str(path), f"cannot be used ({reason.strerror or reason})", mend) from reason


def _files(folder: Path) -> list[str]:
    """Return everything in a folder but folders, as paths from there, sorted."""
    found = (item for item in folder.rglob("*") if item.is_symlink() or not item.is_dir())
    return sorted(item.relative_to(folder).as_posix() for item in found)


def _listed(listing: Path, kind: str) -> set[str]:
    """Return the files of a result, nothing where the listing is none of this kind."""
    if not listing.is_file():
        return set()
    first, *names = listing.read_text(encoding="utf-8", errors="replace").splitlines() or [""]
    return {LISTING, *names} if first == kind else set()


def _some(names: list[str]) -> str:
    rest = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {rest} more" if rest > 0 else "")
