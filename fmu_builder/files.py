"""Writing results so that a reader never sees half of one."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fmu_builder.errors import OutputError

_UNWRITABLE = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def unwritable_character(text: str) -> str | None:
    """Return the first character of `text`, escaped, that XML 1.0 or UTF-8 cannot carry."""
    found = _UNWRITABLE.search(text)
    return None if found is None else ascii(found.group())[1:-1]


def _refused(path: Path, reason: OSError) -> OutputError:
    what = f"cannot be written ({reason.strerror or reason})"
    mend = "Choose another output, or give yourself write permission there"
    return OutputError.of(str(path), what, mend)


def _mode_of_new_files() -> int:
    """Return the permission bits an ordinary new file would get (mkstemp alone gives 0600)."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


@contextmanager
def written_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path` that becomes `path` when the block ends without an error.

    Args:
        path: The file to write; its folder is made when it is missing.

    Yields:
        A temporary path in the same folder, with the same suffix.

    Raises:
        OutputError: The folder or the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    except OSError as reason:
        raise _refused(path, reason) from reason
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(_mode_of_new_files())
        temporary.replace(path)
    except OutputError:  # of another file, which names itself
        raise
    except OSError as reason:
        raise _refused(path, reason) from reason
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> Path:
    """Write `content` to `path` at once or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    with written_atomically(path) as temporary:
        temporary.write_bytes(content)
    return path


def write_text(path: Path, content: str) -> Path:
    """Write `content` as UTF-8 with line feeds to `path` at once or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    return write_bytes(path, content.encode("utf-8"))


@contextmanager
def folder_written_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary folder that takes the place of `path` when the block ends without an error.

    An older folder at `path` stays as it was until then.

    Raises:
        OutputError: The folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}-"))
        temporary.chmod(_mode_of_new_files() | 0o111)
    except OSError as reason:
        raise _refused(path, reason) from reason
    try:
        yield temporary
        if path.exists():
            older = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}-older-"))
            path.replace(older / path.name)
            temporary.replace(path)
            shutil.rmtree(older, ignore_errors=True)
        else:
            temporary.replace(path)
    except OSError as reason:
        raise _refused(path, reason) from reason
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
