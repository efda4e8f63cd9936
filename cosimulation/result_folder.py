"""Folders of results: an earlier run's may be replaced, anything else in a user's place may not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fmu_builder.errors import OutputError
from fmu_builder.files import folder_written_atomically


@contextmanager
def result_folder(path: Path, mark: str, content: str = "") -> Iterator[Path]:
    """Yield a temporary folder that takes the place of `path` when the block ends without an error.

    Args:
        path: The folder of the results. A folder that stands there is replaced as a whole.
        mark: Name of a file that every result of this kind holds; it tells an earlier run's folder.
        content: Text that this file holds in every result, where others may have a file of that name.

    Raises:
        OutputError: `path` is a file, the working folder, or a folder that no earlier run wrote; or it cannot
            be written.
    """
    _refuse_foreign(path, mark, content)
    with folder_written_atomically(path) as temporary:
        yield temporary


def _refuse_foreign(path: Path, mark: str, content: str) -> None:
    mend = "Choose a folder that does not exist yet"
    try:
        whole, here = path.resolve(), Path.cwd()
        if here.is_relative_to(whole):
            raise OutputError.of(str(path), "is the working folder or one above it", mend)
        if path.is_dir():
            if any(path.iterdir()) and not _is_ours(path / mark, content):
                what = f"holds files that no earlier run wrote (no {mark} of one), and would be replaced"
                raise OutputError.of(str(path), what, mend)
        elif path.exists():
            raise OutputError.of(str(path), "is a file, not a folder", mend)
    except OSError as reason:
        if isinstance(reason, OutputError):
            raise
        raise OutputError.of(str(path), f"cannot be used ({reason.strerror or reason})", mend) from reason


def _is_ours(mark: Path, content: str) -> bool:
    return mark.is_file() and content in mark.read_text(encoding="utf-8", errors="replace")
