"""fuzz.inputs with a fault in the program that is watched: `python -m fuzz.faulty_inputs FAULT FOLDER`."""

from __future__ import annotations

import faulthandler
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fuzz import inputs


def _crash(folder: Path) -> None:
    raise IndexError("planted")


def _write_outside(folder: Path) -> None:
    (folder.parent / "planted.txt").write_text("planted")


def _write_outside_unheard(folder: Path) -> None:
    """By another program, beside the file; what Python's audit does not hear."""
    subprocess.run(["cp", "case.fmu", "planted.fmu"], check=True)


def _leave_behind(folder: Path) -> None:
    tempfile.mkdtemp()


def _hang(folder: Path) -> None:
    faulthandler.dump_traceback_later(1, exit=True)  # a minute is long for a test
    time.sleep(3600)


def _use_memory(folder: Path) -> None:
    bytearray(inputs.MEMORY_LIMIT)


def _speak_to_the_terminal(folder: Path) -> None:
    from fmu_builder import errors

    errors.printable = lambda text: text
    inputs.judged("build", "\x1b[2J.json")


def _change_the_file(folder: Path) -> None:
    Path("case.fmu").write_bytes(b"planted")


FAULTS = {
    fault.__name__.removeprefix("_"): fault
    for fault in (
        *(_crash, _write_outside, _write_outside_unheard, _leave_behind, _hang, _use_memory),
        *(_speak_to_the_terminal, _change_the_file),
    )
}


class Faulty(inputs.Archives):
    """The commands, and then the fault."""

    def prepare(self) -> None:
        self.light = {"modelDescription.xml": b"<fmiModelDescription/>"}
        inputs.judged = self._with_fault  # type: ignore[assignment]

    def damaged(self, draw: random.Random) -> bytes:
        return b"no archive"

    def _with_fault(self, *words: str) -> int:
        fault = FAULTS[os.environ["PLANTED"]]
        inputs.judged = _JUDGED
        fault(self.sandbox.folder)
        return 0


_JUDGED = inputs.judged

if __name__ == "__main__":
    os.environ["PLANTED"] = sys.argv[1]
    inputs.KINDS["faulty"] = Faulty
    sys.exit(inputs.main(["faulty", "--folder", sys.argv[2], "--count", "1"]))
