"""The only arithmetic of a local linear model network: C, and the same equations as scalar Python."""

from fmu_builder.kernel.chain import Chain, chain_of, with_parameters
from fmu_builder.kernel.chain_parameters import (
    CHAIN_INPUTS,
    CHAIN_OUTPUTS,
    CHAIN_STATES,
    CHAINS,
    CONTACT_STIFFNESS,
    LARGEST_CONTACT_STIFFNESS,
    LEAST_CONTACT_STIFFNESS,
    ChainParameter,
)
from fmu_builder.kernel.contact import Contact, contact_header, contact_of
from fmu_builder.kernel.native import SOURCES, Network, simulate, static_outputs, validities
from fmu_builder.kernel.node_models import BlendedNodes, blended_nodes
from fmu_builder.kernel.table_writer import tables_header, theta_header
from fmu_builder.kernel.tables import Tables, tables_of, with_validity, without_arrays

__all__ = [
    "CHAINS",
    "CHAIN_INPUTS",
    "CHAIN_OUTPUTS",
    "CHAIN_STATES",
    "CONTACT_STIFFNESS",
    "LARGEST_CONTACT_STIFFNESS",
    "LEAST_CONTACT_STIFFNESS",
    "SOURCES",
    "BlendedNodes",
    "Chain",
    "ChainParameter",
    "Contact",
    "Network",
    "Tables",
    "blended_nodes",
    "chain_of",
    "contact_header",
    "contact_of",
    "simulate",
    "static_outputs",
    "tables_header",
    "tables_of",
    "theta_header",
    "validities",
    "with_parameters",
    "with_validity",
    "without_arrays",
]
