"""What a communication step of an FMU costs. Run: python -m tests.benchmarks.fmu_step

Every step sets all inputs, goes one sample time on and reads all Real outputs, unless it says doStep only.
The networks are the committed ones of `fmus/` from set A, the surrogate once more with another contact
stiffness (its tables then live in the instance), and two made by hand. All FMUs are measured in turns, block
by block, so that what else the machine does hits all of them; a figure is the smallest, over the rounds, of
the median over the blocks of a round (of simulate_fmu, whose runs are long, the CPU time of a run per round).
The clock of the processor is measured in the same turns: 64-bit additions that wait for each other, one cycle
each, and the highest clock of all rounds counts, which makes the floor as low as it can be. The floor is the
multiply-adds of a tick's equations (`multiply_adds`) at one per cycle. Exit status 1
when a limit is missed. Linux and macOS.
"""

from __future__ import annotations

import ctypes
import gc
import shutil
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from fmu_builder.compiler import host_platform, load_native
from fmu_builder.fmi2 import fmi_headers
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.python_fmu import build_python_fmu
from fmus.wbm import build_wbm
from tests.benchmarks import fmu_step_models as models
from tests.fmi.raw import Slave

FOLDER = Path(__file__).parent
ROUNDS, BLOCKS = 8, 40
BLOCK = {"C host": 1000, "fmpy": 50}  # steps; a block is over before another process gets its turn
RUN = 200  # steps of a run of simulate_fmu that are taken off five times as many
SLOW = 500  # times fewer for the Python FMU
MILLION = 1_000_000
CYCLES = 1 << 20
ROWS = 1024
SAMPLE_TIME = 1e-3
MOST_FLOORS = 3.0
MOST_OVER_EMPTY = 1.3
LIMITS = {"surrogate": 150.0, "n4sid": 300.0}  # ns per step with set and get, by what a name begins with
CHANGED = "surrogate, k_E changed"
_ENTRIES = ("set", "SetReal"), ("get", "GetReal"), ("step", "DoStep")


class Host(ctypes.Structure):
    """`Host` of fmu_step_host.c."""

    _fields_ = (
        ("component", ctypes.c_void_p),
        ("set", ctypes.c_void_p),
        ("get", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
        ("clock", ctypes.c_void_p),
        ("input_references", ctypes.c_void_p),
        ("output_references", ctypes.c_void_p),
        ("rows", ctypes.c_void_p),
        ("inputs", ctypes.c_size_t),
        ("outputs", ctypes.c_size_t),
        ("row_mask", ctypes.c_longlong),
        ("sample_time", ctypes.c_double),
        ("clock_id", ctypes.c_int),
        ("step_only", ctypes.c_int),
    )


def address(function: object) -> int | None:
    return ctypes.cast(function, ctypes.c_void_p).value  # type: ignore[arg-type]


def host_library() -> ctypes.CDLL:
    library = load_native("fmu_step_host", FOLDER / "fmu_step_host.c")
    library.host_cycles.restype = ctypes.c_longlong
    return library


@dataclass
class Running:
    """An FMU that stands ready for steps, and where it stands."""

    name: str
    path: Path
    rows: np.ndarray
    slow: int = 1
    parameters: dict[str, float] = field(default_factory=dict)
    position: int = 0
    figures: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        description = fmpy.read_model_description(str(self.path))
        real = [v for v in description.modelVariables if v.type == "Real"]
        self.inputs = [v.valueReference for v in real if v.causality == "input"]
        self.outputs = [v.valueReference for v in real if v.causality == "output"]
        self.input_names = [v.name for v in real if v.causality == "input"]
        self.unpacked = fmpy.extract(str(self.path), str(self.path.with_suffix("")))
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.unpacked,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=self.name,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.setReal(self.inputs, self.rows[0].tolist())
        given = [v.valueReference for name in self.parameters for v in real if v.name == name]
        self.fmu.setReal(given, list(self.parameters.values()))
        self.fmu.exitInitializationMode()
        self.values = np.zeros(max(64, len(self.outputs)))
        self._arrays = (
            np.array(self.inputs, dtype=np.uint32),
            np.array(self.outputs, dtype=np.uint32),
            np.ascontiguousarray(self.rows),
        )

    def host(self, step_only: bool = False) -> Host:
        inputs, outputs, rows = self._arrays
        entries = {name: address(getattr(self.fmu.dll, f"fmi2{entry}")) for name, entry in _ENTRIES}
        return Host(
            component=self.fmu.component,
            clock=address(ctypes.CDLL(None).clock_gettime),
            input_references=inputs.ctypes.data,
            output_references=outputs.ctypes.data,
            rows=rows.ctypes.data,
            inputs=len(inputs),
            outputs=len(outputs),
            row_mask=ROWS - 1,
            sample_time=SAMPLE_TIME,
            clock_id=time.CLOCK_MONOTONIC,
            step_only=step_only,
            **entries,
        )

    def advance(self, count: int) -> int:
        """Return where the next `count` steps begin."""
        self.position += count
        return self.position - count

    def note(self, way: str, nanoseconds: list[float]) -> None:
        self.figures.setdefault(way, []).append(float(np.median(nanoseconds)))

    def cost(self, way: str) -> float:
        """Smallest median [ns per step]."""
        return min(self.figures[way])


def in_c(library: ctypes.CDLL, one: Running, step_only: bool) -> Callable[[int], float]:
    """Return what runs `count` steps in the C host and gives ns per step, by the host's own clock."""
    host, duration = one.host(step_only), ctypes.c_longlong()

    def run(count: int) -> float:
        first = ctypes.c_longlong(one.advance(count))
        values = ctypes.c_void_p(one.values.ctypes.data)
        arguments = (ctypes.byref(host), first, ctypes.c_longlong(count), values, ctypes.byref(duration))
        if library.host_block(*arguments) != 0:
            raise RuntimeError(f"{one.name}: a step failed")
        return duration.value / count

    return run


def in_one_call(library: ctypes.CDLL, one: Running) -> Callable[[int], float]:
    """The same from Python: one ctypes call for `count` steps, outputs into a new array."""
    host = one.host()

    def run(count: int) -> float:
        begin = time.perf_counter_ns()
        table = np.empty((count, len(one.outputs)))
        arguments = (ctypes.c_longlong(one.advance(count)), ctypes.c_longlong(count))
        pointer, width = ctypes.c_void_p(table.ctypes.data), ctypes.c_size_t(table.shape[1])
        if library.host_run(ctypes.byref(host), *arguments, pointer, width) != 0:
            raise RuntimeError(f"{one.name}: a step failed")
        return (time.perf_counter_ns() - begin) / count

    return run


def in_fmpy(one: Running, step_only: bool) -> Callable[[int], float]:
    """A loop over fmpy's methods."""
    fmu, rows = one.fmu, [row.tolist() for row in one.rows]

    def run(count: int) -> float:
        first = one.advance(count)
        begin = time.perf_counter_ns()
        if step_only:
            for k in range(first, first + count):
                fmu.doStep(k * SAMPLE_TIME, SAMPLE_TIME)
        else:
            for k in range(first, first + count):
                fmu.setReal(one.inputs, rows[k % ROWS])
                fmu.doStep(k * SAMPLE_TIME, SAMPLE_TIME)
                fmu.getReal(one.outputs)
        return (time.perf_counter_ns() - begin) / count

    return run


def in_simulate_fmu(one: Running) -> Callable[[int], float]:
    """fmpy's simulate_fmu with inputs at every sample; what a run costs before its steps is taken off."""
    names = ["time", *one.input_names]

    def seconds(count: int) -> float:
        columns = one.rows[np.arange(count + 1) % ROWS].T
        signals = np.rec.fromarrays([np.arange(count + 1) * SAMPLE_TIME, *columns], names=names)
        gc.collect()  # what other runs left would be counted here, or not, by chance
        begin = time.thread_time()
        fmpy.simulate_fmu(
            one.unpacked,
            stop_time=count * SAMPLE_TIME,
            output_interval=SAMPLE_TIME,
            input=signals,
            fmi_type="CoSimulation",
            start_values=dict(zip(one.input_names, one.rows[0], strict=True)),
            validate=False,
        )
        return time.thread_time() - begin

    return lambda count: 1e9 * (seconds(5 * count) - seconds(count)) / (4 * count)


def ways_of(library: ctypes.CDLL, one: Running) -> Iterator[tuple[str, Callable[[int], float], int, int]]:
    """Yield name, run, steps per block and blocks per round of every way to drive an FMU."""
    c_block, python_block = (max(2, steps // one.slow) for steps in BLOCK.values())
    yield "C host", in_c(library, one, False), c_block, BLOCKS
    yield "C host, doStep only", in_c(library, one, True), c_block, BLOCKS
    yield "one ctypes call", in_one_call(library, one), c_block, BLOCKS
    yield "fmpy loop", in_fmpy(one, False), python_block, BLOCKS
    yield "fmpy, doStep only", in_fmpy(one, True), python_block, BLOCKS
    yield "simulate_fmu", in_simulate_fmu(one), RUN if one.slow == 1 else RUN // 4, 1


def measured(library: ctypes.CDLL, all_running: list[Running]) -> float:
    """Measure all FMUs in turns; return the highest clock of the processor [cycles per ns]."""
    ways = [(one, *way) for one in all_running for way in ways_of(library, one)]
    some = all_running[0].host()
    clock = 0.0
    names = list(dict.fromkeys(way[1] for way in ways))
    for _ in range(ROUNDS):
        for name in names:
            turns = [way for way in ways if way[1] == name]
            found: dict[str, list[float]] = {one.name: [] for one, *_ in turns}
            for block in range(BLOCKS):
                for one, _, run, count, blocks in turns:
                    if block < blocks:
                        found[one.name].append(run(count))
                clock = max(
                    clock, CYCLES / library.host_cycles(ctypes.byref(some), ctypes.c_longlong(CYCLES))
                )
            for one, *_ in turns:
                one.note(name, found[one.name])
    return clock


def tail(library: ctypes.CDLL, one: Running) -> tuple[int, np.ndarray]:
    """Return the number of steps timed one by one, and p50, p99.9 and the longest [ns]."""
    count = MILLION // one.slow
    durations = np.empty(count, dtype=np.int32)
    arguments = (ctypes.c_longlong(one.advance(count)), ctypes.c_longlong(count))
    pointers = (ctypes.c_void_p(one.values.ctypes.data), ctypes.c_void_p(durations.ctypes.data))
    if library.host_each(ctypes.byref(one.host()), *arguments, *pointers) != 0:
        raise RuntimeError(f"{one.name}: a step failed")
    return count, np.percentile(durations, [50.0, 99.9, 100.0])


def allocations(one: Running, folder: Path) -> int:
    """Return what a thousand steps take from the heap: the sources with the counting heap of tests/fmi."""
    sources = folder / f"{one.path.stem}_sources"
    with zipfile.ZipFile(one.path) as archive:
        for name in archive.namelist():
            if name.startswith("sources/"):
                archive.extract(name, sources)
    unity = sources / "sources" / "counting.c"
    unity.write_text('#include "all.c"\n#include "counting_heap.c"\n', encoding="utf-8")
    library = load_native("counting", unity, (unity.parent, models.TESTS / "fmi" / "lti_c", fmi_headers()))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    slave = Slave(library, fmpy.read_model_description(str(one.path)).guid)
    slave.start()
    before = library.allocation_count()
    for k in range(1000):
        slave.set(one.inputs, one.rows[k % ROWS].tolist())
        if slave.step(k * SAMPLE_TIME, SAMPLE_TIME) != 0 or slave.get(one.outputs) is None:
            raise RuntimeError(f"{one.name}: a step failed")
    return int(library.allocation_count() - before)


def prepared(folder: Path) -> tuple[list[Running], dict[str, int]]:
    """Build everything; return the FMUs, and the multiply-adds of those that have a floor."""
    here = (host_platform(),)
    sets = models.networks()
    own = {name: build_llmn(one, folder / f"{one.name}.fmu", here) for name, one in sets.items()}
    random = np.random.default_rng(1)
    middle = np.array([sum(limits) / 2.0 for limits in models.inside(list(sets.values()))])
    width = np.array([high - low for low, high in models.inside(list(sets.values()))])
    phase = np.outer(np.arange(ROWS) * 2.0 * np.pi / ROWS, [1.0, 3.0])
    shape = np.sin(phase) + 1e-3 * random.standard_normal((ROWS, 2))
    rows = middle + 0.2 * width * shape
    running = [
        Running("empty slave", models.build_empty(folder / "empty.fmu"), rows),
        Running("wbm", build_wbm(folder / "wbm.fmu", here), np.array([1.5, 1310.9]) + [1e-3, 1.0] * shape),
        *(Running(name, path, rows) for name, path in own.items()),
        Running(
            CHANGED, shutil.copy(own["surrogate"], folder / "changed.fmu"), rows, parameters={"k_E": 2e5}
        ),
        Running(
            "surrogate, pythonfmu",
            build_python_fmu(sets["surrogate"], folder / "python.fmu", here, "surrogate_python"),
            rows,
            slow=SLOW,
        ),
    ]
    work = {name: models.multiply_adds(one) for name, one in sets.items()}
    return running, work | {CHANGED: work["surrogate"]}


def judged(running: list[Running], work: dict[str, int], clock: float, taken: dict[str, int]) -> list[bool]:
    """Print the limits; return whether each is kept."""
    by_name = {one.name: one for one in running}
    empty = by_name["empty slave"].cost("fmpy, doStep only")
    verdicts = []

    def say(passed: bool, text: str) -> None:
        verdicts.append(passed)
        print(f"  {'pass' if passed else 'FAIL'}  {text}")

    for name, count in work.items():
        cost, floor = by_name[name].cost("C host"), count / clock
        about = f"at most {MOST_FLOORS:g}; the floor is {count} multiply-adds, {floor:.1f} ns"
        say(cost <= MOST_FLOORS * floor, f"{name}: {cost / floor:.2f} floors ({about})")
        limit = next(limit for kind, limit in LIMITS.items() if name.startswith(kind))
        say(cost <= limit, f"{name}: {cost:.1f} ns per step (at most {limit:g})")
        ratio = by_name[name].cost("fmpy, doStep only") / empty
        about = f"fmpy, doStep only, at most {MOST_OVER_EMPTY:g}"
        say(ratio <= MOST_OVER_EMPTY, f"{name}: {ratio:.2f} times the empty slave ({about})")
    for name, count in taken.items():
        say(count == 0, f"{name}: {count} allocations in 1000 steps (none allowed)")
    return verdicts


def main() -> int:
    """Print the costs and whether the limits are kept."""
    library = host_library()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        running, work = prepared(folder)
        taken = {one.name: allocations(one, folder) for one in running if one.name in (*work, "wbm")}
        clock = measured(library, running)
        print(f"ns per step of 1 ms, smallest of {ROUNDS} medians; processor clock {clock:.2f} GHz")
        ways = list(running[0].figures)
        print(f"  {'':24s}" + "".join(f"{way:>21s}" for way in ways))
        for one in running:
            print(f"  {one.name:24s}" + "".join(f"{one.cost(way):21.1f}" for way in ways))
        print("every step timed, C host, one look at the clock in each [ns]")
        for one in running:
            count, (half, most, longest) = tail(library, one)
            figures = f"p50 {half:9.0f}   p99.9 {most:9.0f}   max {longest:11.0f}   of {count} steps"
            print(f"  {one.name:24s} {figures}")
        print("limits")
        kept = judged(running, work, clock, taken)
    return int(not all(kept))


if __name__ == "__main__":
    sys.exit(main())
