"""The content of a certificate as one document, from which PDF and XML are generated without additions."""

from collections.abc import Sequence

from pipelines.certificates.document.laboratory import LaboratoryFile
from schemas.strict import Strict
from schemas.units import axes_among


class Result(Strict):
    """A result with its expanded uncertainty (7.8.2.1 m, 7.8.4.1 a).

    value : in ``unit``; None: a figure that is an uncertainty by itself
    expanded : in ``unit``, k : coverage factor, probability 95 %; None of a standard deviation, which has no uncertainty
    """

    quantity: str
    axis: str
    unit: str
    value: float | None
    expanded: float | None
    k: float | None
    dof: float | None


class Coefficient(Strict):
    """A coefficient as the archive has it, with its standard uncertainty of noise."""

    effect: str
    name: str
    axis: str
    value: float
    standard_error: float
    unit: str


class Conformity(Strict):
    """A statement of conformity with its rule and its risk (7.8.6)."""

    figure: str
    value: float
    expanded: float
    limit: float
    accept: float
    unit: str
    outcome: str
    pfa: float


class Contribution(Strict):
    """A row of the uncertainty budget."""

    name: str
    type: str
    distribution: str
    u: float
    unit: str
    share: float
    source: str


def letters_of(coefficients: Sequence[Coefficient]) -> str:
    """The axes that have coefficients of their own, in order."""
    return "".join(axes_among(coefficient.axis for coefficient in coefficients))


class BudgetTable(Strict):
    """The budget of one result.

    u : of the result, in ``unit``; of a result that is a standard deviation itself, the result
    k, expanded : None for such a result
    """

    quantity: str
    unit: str
    u: float
    k: float | None
    expanded: float | None
    rows: tuple[Contribution, ...]


class ReferenceStandard(Strict):
    """A reference standard (7.8.4.1 c)."""

    id: str
    what: str
    certificate: str
    laboratory: str
    date: str
    due: str
    uncertainty: str
    sha256: str


class Condition(Strict):
    """A condition that influences the results (7.8.4.1 b); low and high in ``unit``."""

    name: str
    low: float
    high: float
    unit: str


class Adjustment(Strict):
    """As found and as left (7.8.4.1 d): readings of this calibration, corrected with the earlier coefficients and with the new.

    earlier : number of the earlier certificate, empty where there is none; text : what is said where no figure can be given
    found_rms_ug, found_max_ug, left_rms_ug, left_max_ug : of | |a| − g | in the dwells of this calibration
    """

    earlier: str
    earlier_date: str
    text: str
    dwells: int = 0
    found_rms_ug: float | None = None
    found_max_ug: float | None = None
    left_rms_ug: float | None = None
    left_max_ug: float | None = None


class Amendment(Strict):
    """The certificate that is replaced and the change, or the certificate that has replaced this one (7.8.8)."""

    replaces: tuple[str, ...] = ()
    reason: str = ""
    replaced_by: str = ""


class ResponsePoint(Strict):
    """A point of a transfer function: amplitude and temperature at which it was measured, magnitude and phase with U and k."""

    frequency_hz: float
    level_g: float
    temperature_C: float
    magnitude: float
    magnitude_expanded: float
    magnitude_k: float
    phase_deg: float
    phase_expanded: float
    phase_k: float


class CurveParameter(Strict):
    """A parameter of the curve, with its U."""

    name: str
    unit: str
    value: float
    expanded: float
    k: float


class Curve(Strict):
    """The model through the points of a transfer function, and the band in which it holds.

    covariance : of the parameters in their units, lower triangle row by row; what all points have in common is not in it
    """

    model: str
    verdict: str
    p_value: float
    low_hz: float
    high_hz: float
    parameters: tuple[CurveParameter, ...]
    covariance: tuple[float, ...]


class Response(Strict):
    """Sensitivity over frequency; unit : of the magnitude."""

    title: str
    axis: str
    unit: str
    points: tuple[ResponsePoint, ...]
    curve: Curve | None


class CertificateContent(Strict):
    """One certificate of one unit.

    grade_statement : probability that the item exceeds the limit of its grade within the period; empty where it is not known
    adequacy : verdict on the model with its p, as certified; left_out : contributions that U does not contain
    statement_rule : rule of decision; interval : empty unless the customer agreed to have one printed
    software : release that computed the results; certified_sha256 : of the table ``certified_table``
    """

    number: str
    issued: str
    serial: str
    device: str
    grade: str
    run: str
    measured_from: str
    measured_to: str
    simulated: bool
    who: LaboratoryFile
    method: str
    norms: tuple[str, ...]
    frame: str
    conditions: tuple[Condition, ...]
    references: tuple[ReferenceStandard, ...]
    traceability: str
    results: tuple[Result, ...]
    responses: tuple[Response, ...]
    budgets: tuple[BudgetTable, ...]
    coefficients: tuple[Coefficient, ...]
    conformity: tuple[Conformity, ...]
    decision_rule: str
    limits: str
    grade_statement: str
    adjustment: Adjustment
    amendment: Amendment
    interval: str
    adequacy: str
    left_out: str
    uncertainty_note: str
    declaration: str
    software: str
    certified_table: str
    certified_sha256: str
