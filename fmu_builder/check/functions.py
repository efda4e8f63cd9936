"""Which functions an FMU has to export (FMI 2.0.4, sections 2.1, 3.2 and 4.2)."""

from __future__ import annotations

from collections.abc import Mapping


def _named(names: str) -> frozenset[str]:
    return frozenset("fmi2" + name for name in names.split())


COMMON = _named("""
    GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
    EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString
    SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize
    SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative
""")
OF_INTERFACE: Mapping[str, frozenset[str]] = {
    "CoSimulation": _named("""
        SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus
        GetIntegerStatus GetBooleanStatus GetStringStatus
    """),
    "ModelExchange": _named("""
        EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime
        SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates
        GetNominalsOfContinuousStates
    """),
}
