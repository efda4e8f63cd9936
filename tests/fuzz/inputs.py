"""Thousands of damaged files against `llmn check`, `validate` and `build`, in a process that is watched.

Run by test_fuzz_inputs.py and by `make fuzz`:
    python -m fuzz.inputs KIND --folder FOLDER [--first N] [--count N] [--seconds S]

Case n of a kind is always the same bytes. A case is a finding when it gives anything but messages and exit
status 0 or 1, takes more than a minute or too much memory, writes outside of FOLDER, leaves a file behind,
or (parameter sets) is taken but makes an FMU with errors or C that does not compile.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import gc
import io
import json
import os
import random
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fuzz import archives, texts

TIME_LIMIT = 60  # s, of one case
MEMORY_LIMIT = 3 << 30  # bytes of addresses, libraries included
MOST_FINDINGS = 5
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
# Audit event -> which of its arguments are paths, and which is a folder's descriptor they count from.
_EVENTS = {
    "os.mkdir": ((0,), 2), "os.rename": ((0, 1), 2), "os.symlink": ((1,), 2), "os.link": ((1,), 3),
    "os.remove": ((0,), 1), "os.rmdir": ((0,), 1), "os.truncate": ((0,), None), "os.chmod": ((0,), 2),
}  # fmt: skip
_COMPILE_EVERY = 12  # of the parameter sets that are taken


@dataclass
class Watch:
    """What is written outside of a folder, while it is on."""

    folder: Path
    on: bool = False
    outside: list[str] = field(default_factory=list)

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Take an event of Python's audit."""
        if not self.on:
            return
        if event == "open":
            path, mode, flags = arguments
            writes = any(letter in mode for letter in "wax+") if mode else bool((flags or 0) & _WRITING)
            if writes:
                self._note(event, path)
        elif event in _EVENTS:
            paths, descriptor = _EVENTS[event]
            if descriptor is None or arguments[descriptor] == -1:
                for at in paths:
                    self._note(event, arguments[at])

    def _note(self, event: str, path: Any) -> None:
        if isinstance(path, int) or os.fsdecode(path) == os.devnull:
            return
        where = os.path.realpath(os.path.join(os.getcwd(), os.fsdecode(path)))
        if not where.startswith(str(self.folder) + os.sep):
            self.outside.append(f"{event} {where}")


class FoundError(Exception):
    """A case is a finding."""


@dataclass(frozen=True)
class Sandbox:
    """Where a process of cases works: `work` holds its files, `temporary` is what programs use as such."""

    folder: Path
    work: Path
    temporary: Path
    watch: Watch

    @classmethod
    def enter(cls, folder: Path) -> Sandbox:
        """Move this process there, for good."""
        root = Path(os.path.realpath(folder))
        work, temporary, home = (root / name for name in ("work", "tmp", "home"))
        for one in (work, temporary, home):
            one.mkdir(parents=True, exist_ok=True)
        os.environ.update(TMPDIR=str(temporary), HOME=str(home), XDG_CACHE_HOME=str(home / ".cache"))
        tempfile.tempdir = str(temporary)
        os.chdir(work)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
        watch = Watch(root)
        sys.addaudithook(watch.hear)
        return cls(root, work, temporary, watch)

    def assert_clean(self, *kept: Path) -> None:
        """Look for what should not be there; delete it, so that it is found once."""
        found = sorted(set(self.work.iterdir()) - set(kept)) + sorted(self.temporary.iterdir())
        outside, self.watch.outside[:] = list(self.watch.outside), []
        for path in (*found, *kept):
            _delete(path)
        if found or outside:
            raise FoundError(f"left behind: {[str(path) for path in found]}; written outside: {outside}")


def _delete(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        for inner in path.iterdir():
            _delete(inner)
        path.rmdir()
    else:
        path.unlink(missing_ok=True)


def command(*words: str) -> tuple[int, str, str]:
    """Run the llmn command in this process; its exit status and what it printed."""
    from cosimulation.cli import main

    out, err = (
        io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors=how) for how in ("strict", "backslashreplace")
    )
    before, sys.argv = sys.argv, ["llmn", *words]
    status: object = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as leaving:
        status = leaving.code or 0
    finally:
        sys.argv = before
    texts_ = []
    for stream in (out, err):
        stream.flush()
        texts_.append(stream.buffer.getvalue().decode())  # type: ignore[attr-defined]
    return int(str(status)), texts_[0], texts_[1]


def judged(*words: str) -> int:
    """Run the command and judge what a person gets to see; its exit status."""
    status, out, err = command(*words)
    if status not in (0, 1):
        raise FoundError(f"exit status {status}: {err[:2000]}")
    if status == 1 and not (out or err):
        raise FoundError("refused without a word")
    if "Traceback" in out + err:
        raise FoundError(f"not a message: {err[:2000]}")
    odd = {letter for letter in out + err if not letter.isprintable()} - {"\n"}
    if odd:
        raise FoundError(f"letters that steer a terminal: {odd!r}")
    if "--json" in words:
        json.loads(out or "{}")
    return status


def _base_fmu(folder: Path) -> dict[str, bytes]:
    from fmi import lti

    path = lti.build(folder / "lti_test.fmu", ("linux64", "win64", "aarch64-darwin"))
    content = archives.content_of(path)
    path.unlink()
    return content


def _without_binaries(content: dict[str, bytes]) -> dict[str, bytes]:
    """With a binary that does not load: this process shall live."""
    kept = {name: data for name, data in content.items() if not name.startswith("binaries/")}
    return {**kept, "binaries/linux64/lti_test.so": b"not a library"}


class Cases:
    """One kind of damage; `run` is one case of it."""

    suffix = ".fmu"

    def __init__(self, sandbox: Sandbox) -> None:
        self.sandbox = sandbox
        self.prepare()

    def prepare(self) -> None:
        """Make what is damaged, once."""
        self.whole = _base_fmu(self.sandbox.work)
        self.light = _without_binaries(self.whole)
        self.data = self.sandbox.folder / "data.csv"
        self.data.write_text("time [s],drive [N],load [N],x_1 [m]\n0,0,0,0\n0.001,0,0,0\n0.002,0,0,0\n")

    def damaged(self, draw: random.Random) -> bytes:
        """Return the bytes of a file."""
        raise NotImplementedError

    def run(self, path: Path, draw: random.Random) -> None:
        """Give the file to the commands."""
        before = path.read_bytes()
        judged("check", "--static", *(("--json",) if draw.random() < 0.3 else ()), str(path))
        if draw.random() < 0.5 and b"not a library" in before:
            judged("validate", str(path), "--data", str(self.data))
        if path.read_bytes() != before:
            raise FoundError("the file itself was changed")
        self.sandbox.assert_clean(path)


class Archives(Cases):
    """The zip file."""

    def damaged(self, draw: random.Random) -> bytes:
        return archives.damaged(self.light, draw)


class Descriptions(Cases):
    """modelDescription.xml."""

    def damaged(self, draw: random.Random) -> bytes:
        text = self.light["modelDescription.xml"].decode()
        return _zipped({**self.light, "modelDescription.xml": texts.damaged_xml(text, draw)})


class Binaries(Cases):
    """One of the binaries: for reading only."""

    def damaged(self, draw: random.Random) -> bytes:
        name = draw.choice([name for name in self.whole if name.startswith("binaries/")])
        content = bytearray(self.whole[name])
        for _ in range(draw.randint(1, 12)):
            at = draw.randrange(min(len(content), draw.choice((64, 512, 4096, 1 << 20))))
            content[at : at + draw.choice((1, 1, 4, 8))] = draw.choice(
                (b"\0", b"\xff", b"\xff" * 4, b"\x7f", b"\xff" * 8, b"\0" * 8, draw.randbytes(4))
            )
        if draw.random() < 0.1:
            del content[draw.randrange(len(content)) :]
        kept = {key: data for key, data in self.whole.items() if not key.startswith("binaries/")}
        return _zipped({**kept, name: bytes(content)})


class Parameters(Cases):
    """A parameter set, and the FMU of what is taken."""

    suffix = ".json"

    def prepare(self) -> None:
        import networks
        import theta_networks

        sets = [networks.network(k, *variant) for k, variant in enumerate(networks.VARIANTS[::5])]
        sets.append(theta_networks.theta_network("chain8", nodes=5))
        self.sets = [json.loads(one.canonical_json()) for one in sets]
        self.taken = 0

    def damaged(self, draw: random.Random) -> bytes:
        return texts.damaged_json(draw.choice(self.sets), draw)

    def run(self, path: Path, draw: random.Random) -> None:
        from fmu_builder import parameter_set
        from fmu_builder.errors import LlmnError
        from fmu_builder.llmn_fmu import build_llmn

        fmu = path.with_suffix(".fmu")
        try:
            parameters = parameter_set.load(path)
        except LlmnError:
            if judged("build", str(path)) != 1:
                raise FoundError("build takes what load refuses") from None
            self.sandbox.assert_clean(path)
            return
        self.taken += 1
        try:
            build_llmn(parameters, fmu, ())
        except LlmnError:
            self.sandbox.assert_clean(path)
            return
        self._judge_fmu(fmu)
        if self.taken % _COMPILE_EVERY == 0:
            if judged("build", str(path), "--platform", "linux64") != 0:
                raise FoundError("a parameter set that is taken makes no FMU")
            self._judge_fmu(fmu)
        self.sandbox.assert_clean(path, fmu)

    def _judge_fmu(self, fmu: Path) -> None:
        status, out, err = command("check", "--static", str(fmu))
        if status != 0:
            raise FoundError(f"an FMU with errors: {out[:2000]}{err[:2000]}")


KINDS: dict[str, type[Cases]] = {
    "archives": Archives,
    "descriptions": Descriptions,
    "binaries": Binaries,
    "parameters": Parameters,
}


def _zipped(content: dict[str, bytes]) -> bytes:
    return archives.packed(archives.entries_of(content))


def _numbers(first: int, count: int, seconds: float) -> Iterator[int]:
    end = time.monotonic() + seconds
    number = first
    while number < first + count if count else time.monotonic() < end:
        yield number
        number += 1


def run_case(cases: Cases, kind: str, number: int) -> str | None:
    """Run one case; None, or what it found, with the file kept in the sandbox's folder."""
    draw = random.Random(f"{kind} {number}")
    content = cases.damaged(draw)
    path = cases.sandbox.work / f"case{cases.suffix}"
    path.write_bytes(content)
    faulthandler.dump_traceback_later(TIME_LIMIT, exit=True)
    cases.sandbox.watch.on = True
    try:
        cases.run(path, draw)
        return None
    except Exception as reason:
        kept = cases.sandbox.folder / f"{kind}-{number}{cases.suffix}"
        kept.write_bytes(content)
        what = str(reason) if isinstance(reason, FoundError) else traceback.format_exc()
        return f"{kept}: {what}"
    finally:
        cases.sandbox.watch.on = False
        faulthandler.cancel_dump_traceback_later()
        with contextlib.suppress(FoundError):
            cases.sandbox.assert_clean()


def main(words: Sequence[str] | None = None) -> int:
    """Run cases of one kind; exit status 1 when something was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=0, help="cases; 0: as many as the time allows")
    parser.add_argument("--seconds", type=float, default=60.0)
    chosen = parser.parse_args(words)
    cases = KINDS[chosen.kind](Sandbox.enter(chosen.folder))
    done, found = 0, 0
    for number in _numbers(chosen.first, chosen.count, chosen.seconds):
        trouble = run_case(cases, chosen.kind, number)
        done += 1
        if trouble is not None:
            print(f"FOUND {trouble}\n", flush=True)
            found += 1
            if found == MOST_FINDINGS:
                break
        if done % 200 == 0:
            gc.collect()
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    taken = f", {cases.taken} taken" if isinstance(cases, Parameters) else ""
    print(f"{chosen.kind}: {done} cases{taken}, {found} findings, largest memory {largest} MiB")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
