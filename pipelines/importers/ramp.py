"""A temperature ramp in one pose: a cubic against the noise from sample to sample."""

import numpy as np

from inertial.fits.polynomial import fit_temperature_curve
from pipelines.importers.judged import FitAnswer
from pipelines.importers.mapping import Mapping
from pipelines.importers.record import Imported
from schemas.errors import WrongUse
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2


def ramp(data: Imported, mapping: Mapping) -> FitAnswer:
    """A cubic in temperature of a record in one pose; adequate only if the residual is sample noise."""
    if data.samples is None or "unit_C" not in data.samples.columns:
        raise WrongUse(
            "import: --fit temperature works on samples with a temperature; map temperature=…, without --set rows=dwells"
        )
    output = data.samples[list(AXES)].to_numpy(dtype=np.float64)
    fit = fit_temperature_curve(output, data.samples["unit_C"].to_numpy(dtype=np.float64))
    gravity = mapping.norm_g or 1.0
    per_g = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2}.get(
        data.out_unit, float(np.mean(np.linalg.norm(output, axis=1))) / gravity
    )
    ratio = fit.rms / fit.noise
    document = {
        "adequate": fit.adequate,
        "error": {
            "rms_ug": (MICRO * fit.rms / per_g).tolist(),
            "floor_ug": (MICRO * fit.noise / per_g).tolist(),
            "ratio": ratio.tolist(),
            "p_value": fit.p_value.tolist(),
        },
        "coefficients": fit.coefficients.tolist(),
        "reference_C": fit.reference_temperature,
        "residual_rms": fit.rms.tolist(),
        "noise": fit.noise.tolist(),
    }
    lines = tuple(
        f"{AXES[k]}: the residual of a cubic in temperature is {fit.rms[k]:.3g} {data.out_unit}, {ratio[k]:.1f} times the "
        f"noise of a sample ({fit.noise[k]:.3g}, from first differences)"
        for k in range(3)
    )
    again = "import it again with --set face=FACE (the face that is up) --set local_gravity_m_s2=M/S2 --set block_s=60, then "
    advice = [
        "something other than temperature itself drives this output, such as its rate or a lag",
        f"to look further: {'' if mapping.face else again}'tumbleline diagnose RUN'",
    ]
    if fit.adequate is None:
        reason = "the noise of a sample or the residual is undefined; check the record for constant channels"
        advice = [f"cannot be judged: {reason}"]
    return FitAnswer("temperature", fit.adequate, document, lines if fit.adequate else (*lines, *advice))
