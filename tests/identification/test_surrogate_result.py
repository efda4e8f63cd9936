"""What a surrogate tells of itself: bounds, doubts, correlations, how each theta was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_chains import CHAIN, HEAD, noisy, random_chain, recorded, static_map

from fmu_builder.errors import IdentificationError
from fmu_builder.parameter_set import SurrogateCertainty
from identification import n4sid
from identification.data_set import DataSet
from identification.subspace import SubspaceSettings
from identification.surrogate import SurrogateResult, SurrogateSettings, identify
from identification.surrogate.frequency_response import fit_frequency_response

THETA = random_chain(2)
ONE_MODEL = n4sid.N4sidSettings(local_models=1, subspace=SubspaceSettings(order=6, block_rows=100))


@pytest.fixture(scope="module")
def found() -> tuple[SurrogateResult, DataSet]:
    """A linear plant with one local model, a few steps of output error."""
    data = noisy(recorded(THETA, 2, 8.0), 2, 1)
    local = n4sid.identify([data], ONE_MODEL, static_map(THETA))
    return identify(local, [data], HEAD, SurrogateSettings(output_error={"iterations": 5})), data


def test_what_runs_away_is_refused_in_words(found, monkeypatch: pytest.MonkeyPatch) -> None:
    result, data = found

    def falling(*given, **more):
        fit = fit_frequency_response(*given, **more)
        return replace(fit, theta=np.where(np.array(CHAIN.names) == "c_W", -1e5, fit.theta))

    monkeypatch.setattr("identification.surrogate.job.fit_frequency_response", falling)
    with pytest.raises(IdentificationError, match="unstable on whole-range data"):
        identify(result.local, [data], HEAD, SurrogateSettings(output_error={"iterations": 5}))


def test_bounds_of_the_physical_theta_are_flagged_too(found) -> None:
    result, _ = found
    held = np.where(np.array(CHAIN.names) == "m_H", 50.0, result.physical)
    errors = np.where(np.array(CHAIN.names) == "m_H", np.nan, 0.01 * np.abs(held))
    errors[0, CHAIN.names.index("k_W")] = 1e6
    parameters = replace(result.physical_parameters, theta=held)
    moved = replace(result, physical_parameters=parameters, physical_errors=errors)
    stored = moved.parameters()
    assert stored.physical_at_bound == (("m_H",),) and stored.at_bound == ((),)
    assert stored.certainty is not None
    first, second = stored.certainty.physical_remarks
    assert first == "m_H[1] stands at a bound: no standard error"
    assert second.startswith("k_W[1] = ") and second.endswith("+- 1e+06 N/m cannot be told from zero")
    nothing = replace(moved, physical_errors=np.full((1, 8), np.nan)).remarks("physical")
    assert nothing[1].startswith("local model 1: a tenth left out gives no model")
    assert not replace(result, certainty=None).remarks("physical")


def test_what_is_told_is_told_of_the_theta_that_is_recommended(found) -> None:
    result, _ = found
    for which, fits in (("physical", result.fit_before), ("tuned", result.fit_after)):
        recommendation = replace(result.recommendation, which=which)
        assert replace(result, recommendation=recommendation).fit == fits
    assert result.fit_before != result.fit_after


def test_what_output_error_started_from_is_told(found) -> None:
    result, _ = found
    assert result.parameters().tuned_from == result.tuned_from == "physical theta"
    given = {"single_start": dict(zip(CHAIN.names, THETA.tolist(), strict=True)), "stages": (1, 2, 4)}
    wanted = result.settings.output_error.model_copy(update=given)
    frame = replace(result.frame, settings=result.settings.model_copy(update={"output_error": wanted}))
    assert replace(result, frame=frame).tuned_from == "single start that was given, 1 -> 2 -> 4 local models"
    assert replace(result, tuning=None).tuned_from == ""


def test_correlations_beside_a_bound_are_kept(found) -> None:
    result, _ = found
    assert result.certainty is not None
    table = result.certainty.correlations.copy()
    table[0, 3, :] = table[0, :, 3] = np.nan
    stored = replace(result, certainty=replace(result.certainty, correlations=table)).parameters().certainty
    assert stored is not None and stored.correlations[0][3] == (None,) * 8
    assert stored.correlations[0][0][1] == table[0, 0, 1]
    assert SurrogateCertainty.model_validate_json(stored.model_dump_json()) == stored


def test_pairs_that_move_together_are_named(found) -> None:
    result, _ = found
    assert result.certainty is not None
    pairs = (("m_M[3]", "b_M[3]", -0.97), ("k_L[1]", "v0", 0.96))
    told = replace(result, certainty=replace(result.certainty, close=pairs))
    assert told.correlated() == (
        "m_M[3] and b_M[3]: one rises as the other falls (correlation -0.970)",
        "k_L[1] and v0: rise together (correlation 0.960)",
    )
    assert replace(result, certainty=None).correlated() == ()
