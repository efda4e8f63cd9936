"""What does not fit an FMU is refused before it runs: types, units, start values."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim.whole_path import PLATFORMS, WholePath
from cosimulation import fmu_log
from cosimulation.fmu_driver import running_fmu
from cosimulation.fmu_file import open_fmu, same_unit
from cosimulation.validate import validate_fmu
from fmu_builder.errors import DataError, FmuError, SettingsError
from fmu_builder.llmn_fmu import build_llmn
from identification.data_set import DataSet
from identification.residuals import residual_bands
from identification.scores import FIELDS


def recorded(path: Path, unit: str = "m", names: tuple[str, ...] = ("eta", "M_pa", "xi")) -> Path:
    rows = np.tile([1.5, 1310.9, 1.5007], (60, 1)) + np.linspace(0.0, 0.01, 60)[:, None]
    return DataSet("short", 1e-3, names, (unit, "Nm", "m"), rows).save(path)


def with_integer_input(source: Path, target: Path) -> Path:
    """Return an FMU whose description says that the torque is an Integer."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                begin = text.index("<ScalarVariable", text.index('name="eta"'))
                end = text.index("</ScalarVariable>", begin)
                variable = text[begin : text.index("<Real", begin)].replace("continuous", "discrete")
                assert 'name="M_pa"' in variable
                content = (text[:begin] + variable + '<Integer start="1310"/>' + text[end:]).encode()
            copy.writestr(name, content)
    return target


def test_a_column_in_another_unit_is_refused(blow: WholePath, tmp_path: Path) -> None:
    model = blow.fmus["pantograph_n4sid_blow"]
    assert validate_fmu(model, [recorded(tmp_path / "good.npz")]).records  # Nm stands for N.m
    with pytest.raises(DataError, match="'eta' in 'mm'"):
        validate_fmu(model, [recorded(tmp_path / "bad.npz", unit="mm")])


def test_experiments_are_refused_all_at_once_and_before_the_first_runs(
    blow: WholePath, tmp_path: Path
) -> None:
    model = blow.fmus["pantograph_n4sid_blow"]
    good, bad = recorded(tmp_path / "good.npz"), recorded(tmp_path / "bad.npz", unit="mm")
    other = recorded(tmp_path / "other.npz", names=("height", "M_pa", "xi"))
    with pytest.raises(DataError) as refused:
        validate_fmu(model, [good, bad, other])
    assert len(refused.value.problems) == 2
    with pytest.raises(DataError) as refused:
        validate_fmu(model, [tmp_path / "one.csv", good, tmp_path / "two.npz"])
    assert len(refused.value.problems) == 2


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [("N.m", "Nm", True), ("N*m", "N.m", True), ("", "m", True), (None, "m", True), ("mm", "m", False)],
)
def test_units_are_compared_as_far_as_they_are_known(one: str | None, other: str, same: bool) -> None:
    assert same_unit(one, other) is same


def test_an_input_that_is_not_real_is_not_passed_over(blow: WholePath, tmp_path: Path) -> None:
    fmu = with_integer_input(blow.white_box, tmp_path / "integer.fmu")
    with pytest.raises(DataError, match="type Integer"):
        validate_fmu(fmu, [recorded(tmp_path / "data.npz")])
    with open_fmu(fmu) as opened, running_fmu(opened) as instance, pytest.raises(FmuError, match="not Real"):
        instance.run(np.array([[1310.0]]), ["M_pa"], ["xi"], 1e-3)


def test_start_values_need_the_reference_they_are_of(blow: WholePath, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="--start"):
        validate_fmu(blow.white_box, [recorded(tmp_path / "data.npz")], None, {"preset": "Blow"})


@pytest.mark.parametrize("value", ["abc", 1.5])
def test_a_start_value_of_an_input_that_the_data_drive_is_refused(
    white_box: Path, tmp_path: Path, value: str | float
) -> None:
    data = recorded(tmp_path / "data.npz")
    with pytest.raises(FmuError, match=f"start value eta = {value}: is an input that the data drive"):
        validate_fmu(white_box, [data], white_box, {"preset": "Blow", "eta": value})


def test_nobody_listens_to_an_instance_that_could_not_be_made(white_box: Path) -> None:
    listening = dict(fmu_log._listeners)
    with open_fmu(white_box) as fmu:
        fmu.description.guid = "that of another model"
        with pytest.raises(FmuError, match="cannot be instantiated"), running_fmu(fmu):
            pass
    assert fmu_log._listeners == listening


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("inner_step", "fast"),
        ("inner_step", float("nan")),
        ("preset", 1.5),
        ("preset", True),
        ("preset", "C"),
    ],
)
def test_a_start_value_of_another_type_is_refused(blow: WholePath, name: str, value: float | str) -> None:
    with open_fmu(blow.white_box) as fmu, running_fmu(fmu) as instance, pytest.raises(FmuError, match=name):
        instance.initialise({name: value})


def test_text_is_read_as_the_type_of_the_start_value(blow: WholePath) -> None:
    forces = []
    for preset, step in (("Blow", "1e-3"), (4.0, 0.001)):
        with open_fmu(blow.white_box) as fmu, running_fmu(fmu) as instance:
            instance.initialise({"preset": preset, "inner_step": step})
            forces.append(instance.get(["F_p"])[0])
    assert forces[0] == forces[1]


def test_time_out_of_range_and_errors_inside_the_bands_are_told(blow: WholePath, tmp_path: Path) -> None:
    """A model with bands from the very data it is validated on: 95 % inside; a third of the time too high."""
    (test,) = blow.data.select("whole_range", "test")
    plain = blow.candidates["pantograph_n4sid_blow"].parameter_set
    own = plain.replaced(residual_bands=residual_bands(plain, [test.data]))
    fmu = build_llmn(own, tmp_path / "own.fmu", PLATFORMS)
    values = test.data.values.copy()
    values[2 * len(values) // 3 :, test.data.names.index("M_pa")] += 500.0
    far = DataSet("far", test.data.sample_time, test.data.names, test.data.units, values)
    files = [test.data.save(tmp_path / "near.npz"), far.save(tmp_path / "far.npz")]
    found = validate_fmu(fmu, files)
    assert found.out_of_range[test.name] < 0.02
    assert abs(found.out_of_range["far"] - 1.0 / 3.0) < 0.02
    assert 0.95 <= found.inside[test.name]["F_p"] < 0.951
    assert found.inside["far"]["F_p"] < 0.8
    assert (
        f"far: out of the trained range {100.0 * found.out_of_range['far']:.2f} % of the time" in found.text()
    )
    assert f"{test.name}: 95.0 % of the errors of F_p inside the error bands" in found.text()
    assert found.summary()["out_of_range"] == found.out_of_range
    assert list(found.records[0]) == list(FIELDS)
    without = validate_fmu(blow.fmus["pantograph_n4sid_blow"], files[:1])
    assert without.inside == {} and "error bands" not in without.text()


def test_an_fmu_that_knows_no_range_tells_none(blow: WholePath, tmp_path: Path) -> None:
    found = validate_fmu(blow.white_box, [recorded(tmp_path / "data.npz")])
    assert found.out_of_range == {} and "range" not in found.text()
