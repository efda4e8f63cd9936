"""Mechanical surrogates of the pantograph: physical parameters, tuned by output error."""

from identification.surrogate.affine import OFFSETS, analyse_offsets
from identification.surrogate.assembly import network, theta_nodes
from identification.surrogate.certainty import LARGEST_CONDITION
from identification.surrogate.chain import STATE_NAMES, Head
from identification.surrogate.exact import exact_chain9, lower_framework
from identification.surrogate.frequency_response import (
    FrequencyResponseFit,
    FrequencyResponseSettings,
    fit_frequency_response,
    input_spectrum,
)
from identification.surrogate.job import identify
from identification.surrogate.output_error import OutputErrorFit, OutputErrorSettings
from identification.surrogate.problem import SIGNALS, NetworkParameters, OutputErrorProblem
from identification.surrogate.result import Recommendation, SurrogateResult, Which
from identification.surrogate.settings import REASONED_START, THESIS, SurrogateSettings, local_model_settings
from identification.surrogate.structure import STRUCTURES, Parameter, Structure

__all__ = [
    "LARGEST_CONDITION",
    "OFFSETS",
    "REASONED_START",
    "SIGNALS",
    "STATE_NAMES",
    "STRUCTURES",
    "THESIS",
    "FrequencyResponseFit",
    "FrequencyResponseSettings",
    "Head",
    "NetworkParameters",
    "OutputErrorFit",
    "OutputErrorProblem",
    "OutputErrorSettings",
    "Parameter",
    "Recommendation",
    "Structure",
    "SurrogateResult",
    "SurrogateSettings",
    "Which",
    "analyse_offsets",
    "exact_chain9",
    "fit_frequency_response",
    "identify",
    "input_spectrum",
    "local_model_settings",
    "lower_framework",
    "network",
    "theta_nodes",
]
