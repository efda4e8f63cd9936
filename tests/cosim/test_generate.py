"""Reference data from somebody else's FMU: other names, other conventions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.whole_path import PLATFORMS, WholePath
from cosimulation.data_folder import load_data_folder
from cosimulation.generate import generate_data, make_data
from cosimulation.settings import GenerateSettings, parse_settings
from fmu_builder.errors import DataError, FmuError, SettingsError
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.parameter_set import ParameterSet
from tolerances import SETTLED

NAMES = {"eta": "wire", "M_pa": "drive", "xi": "head", "xi_dot": "head_rate", "zeta": "bar"}
NAMES["zeta_dot"] = "bar_rate"


@pytest.fixture(scope="module")
def foreign(blow: WholePath, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ParameterSet]:
    """An FMU of a pantograph under names of its own, without the derived forces."""
    known = blow.candidates["pantograph_n4sid_blow"].parameter_set
    renamed = known.replaced(
        name="someone_elses",
        inputs=tuple(item.model_copy(update={"name": NAMES[item.name]}) for item in known.inputs),
        outputs=tuple(item.model_copy(update={"name": NAMES[item.name]}) for item in known.outputs),
        partition=known.partition.model_copy(update={"scheduling": "wire"}),
        derived_outputs=(),
        trained_region=None,  # it goes by the old names
    )
    path = tmp_path_factory.mktemp("foreign") / "someone_elses.fmu"
    return build_llmn(renamed, path, PLATFORMS), renamed


def settings(fmu: Path, **changes: object) -> GenerateSettings:
    values: dict[str, object] = {
        "seed": 7,
        "reference": {"fmu": str(fmu)},
        "signals": {
            "inputs": {name: NAMES[name] for name in ("eta", "M_pa")},
            "outputs": {name: NAMES[name] for name in ("zeta_dot", "xi")},
        },
        "experiments": [
            {"name": "op", "kind": "operating_point", "split": "train", "height": 1.1, "duration": 3.0},
            {"name": "wr", "kind": "whole_range", "split": "test", "duration": 5.0},
        ],
        "static_map": {"heights": 9},
    }
    return parse_settings(GenerateSettings, {**values, **changes}, "test")


def test_signals_are_mapped_by_name(foreign: tuple[Path, ParameterSet]) -> None:
    fmu, model = foreign
    data = make_data(settings(fmu))
    found = data.experiments[0].data
    assert found.names == ("eta", "M_pa", "zeta_dot", "xi")
    assert found.units == ("m", "N.m", "m/s", "m")
    expected = simulate(model, found.matrix(("eta", "M_pa")))
    assert np.array_equal(found.column("xi"), expected[:, 0])
    assert np.array_equal(found.column("zeta_dot"), expected[:, 3])


def test_a_slew_rate_sets_the_speed_of_a_whole_range_run(foreign: tuple[Path, ParameterSet]) -> None:
    whole = {"name": "wr", "kind": "whole_range", "split": "test", "duration": 10.0}
    made = make_data(settings(foreign[0], experiments=[whole, {**whole, "name": "fast", "slew_rate": 0.15}]))
    once, fast = (item.data.column("eta") for item in made.experiments)
    assert abs(once[5000] - 2.4) < 0.01 and abs(fast[5000] - 1.35) < 0.01 and abs(fast[-1] - 2.1) < 0.01
    written = made.origin["settings"]["experiments"]
    assert "slew_rate" not in written[0] and written[1]["slew_rate"] == 0.15


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"slew_rate": -0.1}, "slew_rate"),
        ({"kind": "operating_point", "height": 1.0, "slew_rate": 0.1}, "a slew_rate is of a whole_range"),
        ({"duration": None, "file": "recorded.csv", "slew_rate": 0.1}, "not read from a file"),
    ],
)
def test_a_slew_rate_where_it_means_nothing_is_refused(changes: dict[str, object], said: str) -> None:
    whole = {"name": "wr", "kind": "whole_range", "split": "test", "duration": 10.0}
    with pytest.raises(SettingsError, match=said):
        parse_settings(GenerateSettings, {"experiments": [whole | changes]}, "test")


def test_settling_finds_the_states_that_initialising_finds(foreign: tuple[Path, ParameterSet]) -> None:
    fmu, _ = foreign
    at_once = make_data(settings(fmu)).static_map
    settled = make_data(
        settings(fmu, static_map={"heights": 9, "method": "settle", "settling_time": 5.0})
    ).static_map
    assert at_once is not None
    assert settled is not None
    assert len(at_once.positions) == 9
    assert np.abs(at_once.values - settled.values).max() < SETTLED


def test_a_folder_reads_back_as_it_was(foreign: tuple[Path, ParameterSet], tmp_path: Path) -> None:
    chosen = settings(foreign[0], output=str(tmp_path / "data"))
    made = make_data(chosen)
    read = load_data_folder(generate_data(chosen))
    assert [item.data.content_hash for item in read.experiments] == [
        item.data.content_hash for item in made.experiments
    ]
    assert read.static_map is not None
    assert made.static_map is not None
    assert np.array_equal(read.static_map.values, made.static_map.values)
    assert read.origin["reference"]["sha256"] == made.origin["reference"]["sha256"]
    assert str(tmp_path) not in (tmp_path / "data" / "data.json").read_text(encoding="utf-8")


def test_noise_is_put_on_training_data_only(foreign: tuple[Path, ParameterSet]) -> None:
    clean = make_data(settings(foreign[0]))
    noisy = make_data(settings(foreign[0], noise={"position": 1e-5, "velocity": 1e-3}))
    train, test = [
        a.data.values - b.data.values for a, b in zip(noisy.experiments, clean.experiments, strict=True)
    ]
    assert not test.any()
    assert not train[:, :2].any()
    assert np.allclose(train[:, 2:].std(axis=0), [1e-3, 1e-5], rtol=0.1)


def test_data_that_were_changed_behind_the_index_are_refused(
    foreign: tuple[Path, ParameterSet], tmp_path: Path
) -> None:
    folder = generate_data(settings(foreign[0], output=str(tmp_path / "data")))
    (folder / "op.npz").write_bytes((folder / "wr.npz").read_bytes())
    with pytest.raises(DataError, match="another content hash"):
        load_data_folder(folder)


def test_a_missing_split_is_named(foreign: tuple[Path, ParameterSet]) -> None:
    with pytest.raises(DataError, match="'validation'"):
        make_data(settings(foreign[0])).select("whole_range", "validation")


def test_an_unknown_preset_is_answered_with_the_known_ones(blow: WholePath) -> None:
    reference = blow.settings.reference.model_copy(update={"start_values": {"preset": "blow"}})
    with pytest.raises(FmuError, match="A, A60, B, Blow"):
        make_data(blow.settings.model_copy(update={"reference": reference}))


def test_experiments_without_anything_to_drive_are_named_all_at_once() -> None:
    with pytest.raises(SettingsError) as caught:
        make_data(settings(Path("x.fmu"), reference={}))
    assert len(caught.value.problems) == 2


def test_recorded_files_are_refused_all_at_once_before_anything_is_driven(tmp_path: Path) -> None:
    (tmp_path / "cut.csv").write_text("time [s],eta [m]\n0.0,1.5\n0.001,", encoding="utf-8")
    common = {"kind": "whole_range", "split": "train"}
    experiments = [
        {"name": "driven", "duration": 1.0, **common},
        {"name": "cut", "file": tmp_path / "cut.csv", **common},
        {"name": "missing", "file": tmp_path / "missing.csv", **common},
    ]
    folder = tmp_path / "data"
    chosen = {"experiments": experiments, "output": folder, "reference": {"fmu": tmp_path / "none.fmu"}}
    with pytest.raises(DataError) as caught:
        generate_data(parse_settings(GenerateSettings, chosen, "test"))
    assert {Path(problem.place).name for problem in caught.value.problems} == {"cut.csv", "missing.csv"}
    assert [item.name for item in tmp_path.iterdir()] == ["cut.csv"]
