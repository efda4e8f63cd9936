"""sources/buildDescription.xml: how to compile the sources, in the words of FMI 3.0.

FMI 2.0 names the files to compile (`SourceFiles`) and no more. Tools that read this file learn the language,
too, and that nothing else is needed.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

from fmu_builder.fmi2.description import UNITY_NAME
from fmu_builder.fmi2.interface import Interface

BUILD_DESCRIPTION = "buildDescription.xml"


def build_description(interface: Interface) -> str:
    """Return the text of buildDescription.xml (FMI 3.0, section 2.5): one C99 file, no libraries.

    FMI2_FUNCTION_PREFIX is not among the definitions, even as an optional one: fmpy defines all it finds.

    Args:
        interface: The interface of the FMU.
    """
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(
        root,
        "BuildConfiguration",
        modelIdentifier=interface.model_identifier,
        description="The FMI 2.0 headers come with the importer",
    )
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    ET.SubElement(files, "SourceFile", name=UNITY_NAME)
    ET.indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
