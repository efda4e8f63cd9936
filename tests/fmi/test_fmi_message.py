"""Numbers and text in log messages."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_builder.compiler import load_native
from fmu_builder.fmi2 import C_FOLDER
from tolerances import MESSAGE_DIGITS

CAPACITY = 512


def _library() -> ctypes.CDLL:
    return load_native("message_host", Path(__file__).parent / "message_host.c", (C_FOLDER,))


def written(function: str, *values: object) -> str:
    text = ctypes.create_string_buffer(CAPACITY)
    length = getattr(_library(), "message_of_" + function)(*values, text)
    assert length == len(text.value)
    return text.value.decode()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (1.0, "1"),
        (-12.5, "-12.5"),
        (1310.9, "1310.9"),
        (0.001, "0.001"),
        (0.05, "0.05"),
        (100000.0, "100000"),
        (120000.0, "120000"),
        (999999.6, "1e6"),
        (1234567.0, "1.23457e6"),
        (2.5e-7, "2.5e-7"),
        (1.0 / 3.0, "0.333333"),
        (-1e300, "-1e300"),
        (float("inf"), "infinity"),
        (float("-inf"), "-infinity"),
        (float("nan"), "not-a-number"),
    ],
)
def test_numbers(value: float, text: str) -> None:
    assert written("number", ctypes.c_double(value)) == text


@given(st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False))
@settings(max_examples=300, deadline=None)
def test_any_number_reads_back_to_six_digits(value: float) -> None:
    text = written("number", ctypes.c_double(value))
    assert float(text) == pytest.approx(value, rel=MESSAGE_DIGITS)
    assert len(text) <= len("-1.23456e-300")


@pytest.mark.parametrize("value", [0, 7, -1, 10, 4294967295, -(2**63), 2**63 - 1])
def test_integers(value: int) -> None:
    assert written("integer", ctypes.c_longlong(value)) == str(value)


def test_long_text_is_cut_and_signs_of_loggers_are_taken_out() -> None:
    assert written("text", b"100 % of ", b"#r1#") == "100 ' of 'r1'"
    assert written("text", b"x" * 400, b"y" * 400) == "x" * 400 + "y" * (CAPACITY - 401)
