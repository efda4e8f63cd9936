"""A small FMU of our own to try the FMI layer on, and what it must answer, computed apart in Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fmu_builder.fmi2 import Interface, Variable, build_fmu

C_FOLDER = Path(__file__).parent / "lti_c"
MODEL_HASH = "lti-test-model"
SAMPLE_TIME = 0.001
A = ((-2.0, 30.0), (-41.0, -3.0))
B = ((1.5, 0.2), (0.3, -7.0))
START = (1.25, -0.75)

VARIABLES = (
    Variable(
        "drive", causality="input", unit="m", start=START[0], minimum=-2.0, maximum=3.0, description="first"
    ),
    Variable("load", causality="input", unit="N", start=START[1], description='a < b & "c"'),
    Variable("x_1", causality="output", unit="m", nominal=2.0, dependencies=("x_1",)),
    Variable("scaled", causality="output", unit="m", dependencies=("x_2",)),
    Variable("mixed", causality="output", unit="N", dependencies=("load", "x_1", "x_2")),
    Variable("in_range", type="Boolean", causality="output", dependencies=("drive",)),
    Variable("reciprocal", causality="output", dependencies=("load",)),
    Variable("x_2", unit="m"),
    Variable("der_x_1", unit="m/s", derivative_of="x_1", dependencies=("x_1", "x_2", "drive", "load")),
    Variable("der_x_2", unit="m/s", derivative_of="x_2", dependencies=("x_1", "x_2", "drive", "load")),
    Variable("preset", type="Enumeration", causality="parameter", start=1, enumeration=("weak", "strong")),
    Variable("scale", causality="parameter", unit="1", start=2.5, minimum=0.5, maximum=4.0),
    Variable(
        *("shift",),
        causality="parameter",
        variability="tunable",
        unit="m",
        start=0.0,
        minimum=-1.0,
        maximum=1.0,
    ),
)
INTERFACE = Interface(
    model_identifier="lti_test",
    model_name="LTI test model",
    description="Two states, two inputs, for tests",
    variables=VARIABLES,
    states=("x_1", "x_2"),
    default_step=SAMPLE_TIME,
    stop_time=2.0,
    author="tests",
    event_indicators=2,
)
SAMPLED = replace(
    INTERFACE,
    model_identifier="lti_sampled",
    states=(),
    event_indicators=0,
    variables=tuple(
        replace(
            v, derivative_of=None, dependencies=tuple(d for d in v.dependencies if not d.startswith("x_"))
        )
        for v in VARIABLES
    ),
)
"""The same model without continuous states: in model exchange it runs by ticks, too."""
VR = {variable.name: position for position, variable in enumerate(VARIABLES)}


def build(
    output: Path,
    platforms: Sequence[str],
    c_folder: Path | None = None,
    interface: Interface = INTERFACE,
    pages: Mapping[str, bytes] = {"licenses/license.txt": b"MIT\n"},
) -> Path:
    """Build the test FMU; `c_folder` may hold another FMI layer than the one in use."""
    include = (C_FOLDER,) if c_folder is None else (C_FOLDER, c_folder)
    return build_fmu(
        interface, MODEL_HASH, C_FOLDER / "all.c", include, {}, output, platforms, {"note.txt": b"x"}, pages
    )


def _forcing(inputs: Sequence[float], row: int, strength: float) -> float:
    return strength * (B[row][0] * inputs[0] + B[row][1] * inputs[1])


def steady_state(inputs: Sequence[float], strength: float = 1.0) -> list[float]:
    """Solve A x + B u = 0 in the model's order of operations."""
    determinant = A[0][0] * A[1][1] - A[0][1] * A[1][0]
    first, second = -_forcing(inputs, 0, strength), -_forcing(inputs, 1, strength)
    return [
        (A[1][1] * first - A[0][1] * second) / determinant,
        (A[0][0] * second - A[1][0] * first) / determinant,
    ]


def tick(state: Sequence[float], inputs: Sequence[float], strength: float = 1.0) -> list[float]:
    """Return the state one tick later."""
    return [
        state[row]
        + SAMPLE_TIME * (A[row][0] * state[0] + A[row][1] * state[1] + _forcing(inputs, row, strength))
        for row in (0, 1)
    ]


def run_by_definition(
    steps: Sequence[tuple[float, float, Sequence[float], Sequence[float]]],
) -> list[list[float]]:
    """Return the state after every communication step, straight from the words of the rule.

    Tick n uses the inputs in force in the last step that begins at or before t_n + 0.01 T, advanced to t_n
    with their derivatives; it has run once a step reaches t_n+1 - 0.01 T.

    Args:
        steps: (time, step, inputs, input derivatives) of every communication step.
    """
    state = steady_state(START)
    done = 0
    history = []
    for position, (time, step, _, _) in enumerate(steps):
        while (time + step) / SAMPLE_TIME >= done + 1 - 0.01:
            begun = [k for k in range(position + 1) if steps[k][0] / SAMPLE_TIME <= done + 0.01]
            begin, _, inputs, slopes = steps[begun[-1]]
            ahead = (done - begin / SAMPLE_TIME) * SAMPLE_TIME
            latched = [u + slope * ahead if slope else u for u, slope in zip(inputs, slopes, strict=True)]
            state = tick(state, latched)
            done += 1
        history.append(state)
    return history
