"""Certificates of stability: looked for by semidefinite programmes, proved in exact integers.

The proof is `verify.py`, which needs nothing but Python and can be run alone.
"""

from __future__ import annotations

import json

from fmu_builder.errors import CertificateError
from fmu_builder.parameter_set import ParameterSet, StabilityProof
from identification.stability import verify
from identification.stability.search import found_certificate, seems_provable

__all__ = ["found_certificate", "proved", "seems_provable"]


def proved(parameter_set: ParameterSet) -> StabilityProof | None:
    """Prove anew what the certificate of a parameter set claims; None when it carries none.

    Raises:
        CertificateError: The certificate does not prove what it claims.
    """
    if parameter_set.certificate is None:
        return None
    content = json.loads(parameter_set.canonical_json())
    try:
        shown = verify.verify(content)
    except verify.NotProvedError as reason:
        place = f"{parameter_set.name}, certificate"
        mend = "Look for one anew (llmn prove --anew), or remove it"
        raise CertificateError.of(place, str(reason), mend) from reason
    text = verify.statement(content, shown)
    return StabilityProof(shown.model_hash, shown.rate, shown.move, shown.decay, text, verify.NOT_PROVED)
