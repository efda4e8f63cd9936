"""LOLIMOT: a tree of local ARX models, the thesis's first attempt and a baseline here."""

from identification.lolimot.assembly import as_parameter_set, lolimot_parameter_set
from identification.lolimot.network import ArxNetwork, identify, with_settings
from identification.lolimot.settings import LolimotSettings, Origin, StateSpaceForm

__all__ = [
    "ArxNetwork",
    "LolimotSettings",
    "Origin",
    "StateSpaceForm",
    "as_parameter_set",
    "identify",
    "lolimot_parameter_set",
    "with_settings",
]
