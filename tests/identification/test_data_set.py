from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from fmu_builder.errors import DataError
from identification.arrays import Array
from identification.data_set import DataSet, load


def small(**changes: Any) -> DataSet:
    values = np.array([[1.5, 1310.9, -0.0], [1.1 / 3.0, 1e-300, 7.0], [2.5, 5e-324, 1e300], [0.1, 0.2, 0.3]])
    given = {
        "name": "small",
        "sample_time": 0.001,
        "names": ("eta", "M_pa", "xi"),
        "units": ("m", "N.m", "m"),
    }
    return DataSet(**{**given, "values": values, "header": {"seed": 3, "of": ["a", 1.5]}, **changes})


def refused(*arguments: Any, **named: Any) -> str:
    with pytest.raises(DataError) as error:
        DataSet.load(*arguments, **named) if arguments else small(**named)
    return str(error.value)


def csv(folder: Path, text: str) -> Path:
    path = folder / "data.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_round_trip_keeps_every_bit(tmp_path: Path, suffix: str) -> None:
    data = small()
    back = load(data.save(tmp_path / f"set{suffix}"))
    assert back.values.tobytes() == data.values.tobytes()
    assert (back.name, back.sample_time, back.names, back.units) == ("small", 0.001, data.names, data.units)
    assert back.header == {"seed": 3, "of": ["a", 1.5]}
    assert back.content_hash == data.content_hash


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@given(
    values=arrays(
        np.float64,
        array_shapes(min_dims=2, max_dims=2, max_side=7),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    ),
    step=st.floats(1e-4, 10.0),
)
def test_any_numbers_round_trip(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, values: Array, step: float
) -> None:
    names = tuple(f"s{k}" for k in range(values.shape[1]))
    data = DataSet("any", step, names, ("",) * len(names), values)
    back = load(data.save(tmp_path_factory.mktemp("d") / f"x{suffix}"))
    assert back.values.tobytes() == values.tobytes()
    assert back.sample_time == step


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_same_content_gives_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    first = small().save(tmp_path / f"one{suffix}").read_bytes()
    assert small().save(tmp_path / f"two{suffix}").read_bytes() == first
    changed = small(values=np.nextafter(small().values, 9e9)).save(tmp_path / f"three{suffix}").read_bytes()
    assert changed != first


def test_npz_holds_no_clock_and_opens_with_numpy(tmp_path: Path) -> None:
    path = small().save(tmp_path / "set.npz")
    with zipfile.ZipFile(path) as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert json.loads(archive.read("header.json"))["names"] == ["eta", "M_pa", "xi"]
    assert np.load(path, allow_pickle=False)["values"].shape == (4, 3)


def test_csv_is_what_a_person_expects(tmp_path: Path) -> None:
    lines = small().save(tmp_path / "set.csv").read_text().splitlines()
    assert lines[1] == "time [s],eta [m],M_pa [N.m],xi [m]"
    assert lines[2] == "0.0,1.5,1310.9,-0.0"
    assert len(lines) == 6


def test_content_hash_covers_numbers_names_units_and_step_alone() -> None:
    base = small().content_hash
    assert small(name="other", header={}).content_hash == base
    assert small(sample_time=0.002).content_hash != base
    assert small(units=("m", "N.m", "mm")).content_hash != base
    assert small(names=("eta", "xi", "M_pa")).content_hash != base
    assert small(values=-small().values).content_hash != base


def test_columns_rows_and_joins() -> None:
    data = small()
    assert data.select(("xi", "eta")).values[1].tolist() == [7.0, 1.1 / 3.0]
    assert data.select(("xi", "eta")).units == ("m", "m")
    assert data.column("M_pa")[0] == 1310.9
    assert data.rows(1, 3).values.tolist() == data.values[1:3].tolist()
    assert data.time.tolist() == [0.0, 0.001, 0.002, 0.003]
    joined = data.with_columns(("F",), ("N",), np.ones((4, 1)))
    assert joined.names == (*data.names, "F") and joined.column("F").sum() == 4.0
    with pytest.raises(DataError, match="4 rows"):
        data.with_columns(("F",), ("N",), np.ones((3, 1)))


def test_nobody_can_write_to_it() -> None:
    source = np.ones((2, 3))
    data = small(values=source)
    source[0, 0] = 5.0
    assert data.values[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        data.values[0, 0] = 2.0


def test_missing_columns_are_all_named_with_a_guess() -> None:
    with pytest.raises(DataError) as error:
        small().matrix(("eta", "M_p", "zeta"))
    assert [p.what for p in error.value.problems] == ["has no column 'M_p'", "has no column 'zeta'"]
    assert "Did you mean 'M_pa'?" in str(error.value)


def test_constructor_finds_everything_at_once() -> None:
    values = small().values.copy()
    values[2, 1] = np.nan
    text = refused(values=values, names=("eta", "eta", "a[b"), units=("m",), sample_time=-1.0)
    for part in ("'eta' 2 times", "'a[b'", "1 units for 3", "sample time -1.0", "not finite in row 2"):
        assert part in text
    assert "is empty" in refused(values=np.empty((0, 3)))
    assert "2 names for 3" in refused(names=("eta", "xi"), units=("m", "m"))
    assert "table of numbers" in refused(values=[["a"]])
    assert "JSON" in refused(header={"seed": float("nan")})


def test_bad_cells_name_row_line_and_column(tmp_path: Path) -> None:
    path = csv(tmp_path, "time [s],eta [m],xi [m]\n0,1,2\n0.1,nan,2\n0.2,1,two\n0.3,,inf\n0.4,1,2\n")
    text = refused(path)
    assert "row 2 (line 4), xi [m]: 'two'" in text
    assert "row 3 (line 5), eta [m]: ''" in text
    assert "column 'eta' is NaN or infinite in rows 1 (line 3), 3 (line 5)" in text
    assert "column 'xi' is NaN or infinite in rows 2 (line 4), 3 (line 5)" in text


def test_all_problems_of_a_file_at_once(tmp_path: Path) -> None:
    path = csv(tmp_path, "time [s],eta [m],eta [m]\n0,1,2\n0.1,nan,2\n0.3,1,2\n0.4,1,2,9\n0.5,1,1\n")
    text = refused(path, required=("eta", "M_pa"))
    for part in (
        "'eta' 2 times",
        "row 1 (line 3)",
        "row 2 (line 4) do not follow 0.1 s",
        "4 cells for 3",
        "'M_pa'",
    ):
        assert part in text


def test_not_uniform_names_row_and_step(tmp_path: Path) -> None:
    rows = [f"{0.001 * k:.6f},1.0" for k in range(50)]
    del rows[17]
    text = refused(csv(tmp_path, "time [s],eta [m]\n" + "\n".join(rows)))
    assert "row 17 (line 19) do not follow 0.001 s, the first is 0.002 s" in text
    back = [f"{t},1" for t in (0.0, 0.1, 0.2, 0.15, 0.4)]
    assert "not uniformly sampled" in refused(csv(tmp_path, "time,eta\n" + "\n".join(back)))


def test_printed_times_with_rounding_are_uniform(tmp_path: Path) -> None:
    lines = [f"{5.0 + 0.001 * k:.6g},{k}" for k in range(3000)]
    data = load(csv(tmp_path, "time [s],eta [m]\n" + "\n".join(lines)))
    assert data.sample_time == 0.001 and len(data) == 3000 and data.units == ("m",)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "is empty"),
        ("time [s],eta [m]\n", "no row of numbers"),
        ("eta [m],xi [m]\n1,2\n2,3\n", "no column 'time'"),
        ("time [s],eta [m]\n0,1\n", "too few rows"),
        ("time [s],[m]\n0,1\n1,1\n", "titled '[m]'"),
    ],
)
def test_unusable_csv(tmp_path: Path, text: str, part: str) -> None:
    assert part in refused(csv(tmp_path, text))


def test_unreadable_files(tmp_path: Path) -> None:
    assert "cannot be read" in refused(tmp_path / "nowhere.csv")
    assert "cannot be read" in refused(tmp_path.with_suffix(".npz"))
    assert "suffix" in refused(tmp_path / "data.xlsx")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x80")
    assert "not a text file" in refused(tmp_path / "binary.csv")
    with pytest.raises(DataError, match="suffix"):
        small().save(tmp_path / "set.txt")


def test_every_truncation_of_npz_is_refused(tmp_path: Path) -> None:
    content = small().save(tmp_path / "set.npz").read_bytes()
    for length in range(len(content)):
        (tmp_path / "cut.npz").write_bytes(content[:length])
        assert "cut.npz" in refused(tmp_path / "cut.npz")


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_a_changed_number_is_noticed(tmp_path: Path, suffix: str) -> None:
    path = small().save(tmp_path / f"set{suffix}")
    old, new = (
        (b"1310.9", b"1310.8")
        if suffix == ".csv"
        else (np.float64(1310.9).tobytes(), np.float64(7).tobytes())
    )
    changed = path.read_bytes().replace(old, new)
    if suffix == ".npz":  # with a right checksum: as if somebody had written it
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name).replace(old, new) for name in archive.namelist()}
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            for name, member in members.items():
                archive.writestr(name, member)
        changed = stream.getvalue()
    path.write_bytes(changed)
    assert "does not hold the numbers" in refused(path)


def test_a_truncated_csv_is_noticed(tmp_path: Path) -> None:
    path = small().save(tmp_path / "set.csv")
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    assert "does not hold the numbers" in refused(path)


def test_npz_of_other_origin(tmp_path: Path) -> None:
    path = tmp_path / "foreign.npz"
    columns: dict[str, Any] = {"time": np.arange(4) * 0.5, "eta [m]": np.arange(4.0), "flag": np.arange(4)}
    np.savez(path, **columns)
    data = load(path)
    assert (data.names, data.units, data.sample_time) == (("eta", "flag"), ("m", ""), 0.5)
    np.savez(path, time=np.arange(4), eta=np.arange(3))
    assert "holds time (4,), eta (3,)" in refused(path)
    np.savez(path, time=np.array([{}, {}], dtype=object))
    assert "not a readable .npz" in refused(path)
