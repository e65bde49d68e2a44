"""A reference standard of a station: what its calibrations are traced to, by which certificate, until when."""

from __future__ import annotations

from datetime import date
from typing import Annotated

from pydantic import Field

from schemas.recipe import Strict


class Reference(Strict):
    """A standard with a certificate of its own.

    Parameters
    ----------
    id : the standard's own number.
    what : what it stands for: local gravity, angle, temperature, frequency, …
    certificate : number of its certificate.
    laboratory : who gave it.
    due : the first day on which it has to be calibrated again.
    """

    id: Annotated[str, Field(min_length=1)]
    what: str = ""
    certificate: Annotated[str, Field(min_length=1)]
    laboratory: str = ""
    due: date
