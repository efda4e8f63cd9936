"""What the subspace estimator can be told; everything has a default or is chosen from the data."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Method = Literal["MOESP", "PI-MOESP", "PO-MOESP", "N4SID", "CVA"]
Instrument = Literal["none", "past_inputs", "past"]
Weighting = Literal["moesp", "n4sid", "cva"]

METHODS: dict[Method, tuple[Instrument, Weighting]] = {
    "MOESP": ("none", "moesp"),
    "PI-MOESP": ("past_inputs", "moesp"),
    "PO-MOESP": ("past", "moesp"),
    "N4SID": ("past", "n4sid"),
    "CVA": ("past", "cva"),
}
"""Instruments Z_N (thesis Tables 3.7 and 3.8) and weights W_1, W_2 (Table 3.9) of the named methods."""

LARGEST_ORDER = 200


class SubspaceSettings(BaseModel):
    """Settings of the estimator.

    Noise the methods are made for (thesis 3.5.2): MOESP white noise of one size on all scaled outputs;
    PI-MOESP coloured noise on the outputs; PO-MOESP, N4SID and CVA white noise on outputs and states.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    order: int | Literal["auto"] = Field(
        default="auto", description='number of states n, or "auto": from the singular values'
    )
    least_order: int = Field(
        default=1, ge=1, le=LARGEST_ORDER, description="order that an automatic one is not below"
    )
    block_rows: int | Literal["auto"] = Field(
        default="auto",
        description='length s of past and future windows [samples], or "auto": by simulation error',
    )
    method: Method = Field(default="CVA", description="named choice of instrument and weighting")
    instrument: Instrument | None = Field(default=None, description="Z_N; default that of the method")
    weighting: Weighting | None = Field(default=None, description="W_1, W_2; default that of the method")
    factorisation: Literal["covariance", "qr"] = Field(
        default="covariance", description="triangular factor by Cholesky of the covariance, or by QR"
    )
    noise_floor: float = Field(
        default=1e-3,
        ge=0.0,
        le=1.0,
        description="white output noise the windows are assumed to hold, relative to each signal's std",
    )
    # it leaves the model of a linear plant unchanged and keeps the weighting defined on noise-free data
    feed_through: bool = Field(default=False, description="whether D is estimated; zero otherwise")
    high_order: int | None = Field(
        default=None, ge=2, le=LARGEST_ORDER, description="order identified first, then reduced to `order`"
    )
    reduction: Literal["truncation", "residualisation"] = Field(
        default="truncation", description="weak balanced states are left out, or set to rest"
    )
    stabilisation: Literal["none", "reflect"] = Field(
        default="none", description="unstable poles are refused, or reflected into the unit circle"
    )

    @model_validator(mode="after")
    def _fits_together(self) -> SubspaceSettings:
        wrong = []
        if self.order != "auto" and not 1 <= self.order <= LARGEST_ORDER:
            wrong.append(f"order must be 1 .. {LARGEST_ORDER}")
        if self.block_rows != "auto" and self.block_rows < 2:
            wrong.append("block_rows must be at least 2")
        if self.high_order is not None and self.order != "auto" and self.high_order <= self.order:
            wrong.append("high_order must be above order")
        instrument, weighting = self.combination
        if instrument == "none" and weighting != "moesp":
            wrong.append(f'weighting "{weighting}" needs an instrument: "past_inputs" or "past"')
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    @property
    def combination(self) -> tuple[Instrument, Weighting]:
        """Instrument and weighting: what is set, else what the method names."""
        instrument, weighting = METHODS[self.method]
        return self.instrument or instrument, self.weighting or weighting

    @property
    def identified_order(self) -> int | Literal["auto"]:
        """Order that the singular values have to support."""
        return self.high_order or self.order
