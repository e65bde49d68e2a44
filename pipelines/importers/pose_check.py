"""Check of dwells against their stated faces: exchanged axes, inverted axes, or axes without a response."""

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from inertial.fits.plane import quiet_axis
from inertial.quantities import FORCE_COLUMNS, OUTPUT_COLUMNS
from pipelines.importers.mapping import Mapping
from schemas.errors import DataRejected
from schemas.units import AXES

_DEAD = 0.2
_CLEAR = 0.6
_MISFIT = 0.1
"""Largest unexplained part of gravity for a response of exchanged axes."""
CHECK_AXIS = "CHECK AXIS"
ONE_POSE = (
    "one pose whose force is not known: 'tumbleline noise allan' gives its noise; the bias, and what it follows, need the face "
    "that is up (--set face=+x … -z), --set block_s=S and an output in g; scale and misalignment need more poses"
)
OUT, FORCE = list(OUTPUT_COLUMNS), list(FORCE_COLUMNS)


def silent_axis(dwells: pd.DataFrame) -> str:
    """A sentence on an axis, its letter first, that stays constant while another turns through gravity; else empty."""
    means = dwells[OUT].to_numpy(dtype=np.float64)
    weak = quiet_axis(means)
    if weak is None:
        return ""
    spans = np.ptp(means, axis=0)
    strong = int(np.argmax(spans))
    return (
        f"{AXES[weak]} changes by {spans[weak]:.3g} over {len(means)} dwells, {AXES[strong]} by {spans[strong]:.3g}; "
        f"a dead axis, another quantity mapped as {AXES[weak]}, or a sensor turned about {AXES[weak]} alone (then --fit plane)"
    )


def refuse_or_remark(dwells: pd.DataFrame, mapping: Mapping, where: str) -> tuple[str, ...]:
    """Remarks on dwells, such as an axis that does not respond to positions.

    Raises
    ------
    DataRejected
        The outputs belong to other faces than those named, or an axis does not respond to gravity.
    """
    if FORCE[0] not in dwells.columns and len(dwells) == 1:
        return (ONE_POSE,)
    if len(mapping.axes) < len(AXES):
        return ()  # one axis has no order, and its sign is judged with the dwells
    if not mapping.poses or FORCE[0] not in dwells.columns:
        silent = silent_axis(dwells)
        return (f"{CHECK_AXIS} {silent[0]}: {silent}",) if silent else ()
    force, output = dwells[FORCE].to_numpy(dtype=np.float64), dwells[OUT].to_numpy(dtype=np.float64)
    design = np.column_stack([np.ones(len(force)), force])
    if np.linalg.matrix_rank(design, tol=0.1) < 4:
        return ()
    fit = np.linalg.lstsq(design, output, rcond=None)[0]
    response = fit[1:].T
    size = np.linalg.norm(response, axis=1)
    misfit = float(np.sqrt(np.mean((output - design @ fit) ** 2)))
    if misfit > _MISFIT * float(np.median(size)):
        return ()  # some labels are wrong, not the axes: the verdict of the fit shows it
    weak = np.flatnonzero(size < _DEAD * np.median(size))
    if weak.size:
        axis = AXES[int(weak[0])]
        raise DataRejected(
            f"{where}: axis {axis} responds to gravity with {100.0 * size[weak[0]] / np.median(size):.3g} % of the other axes; "
            f"its column must be an acceleration; correct --map {axis}=…, or repair the channel"
        )
    shares = response / size[:, None]
    rows, columns = linear_sum_assignment(-np.abs(shares))
    signs = np.sign(shares[rows, columns])
    if np.min(np.abs(shares[rows, columns])) < _CLEAR or (np.array_equal(rows, columns) and np.all(signs > 0)):
        return ()
    reads = list(zip(rows.tolist(), columns.tolist(), (signs > 0).tolist(), strict=True))
    found = ", ".join(f"{AXES[i]} reads {'+' if same else '-'}{AXES[j]}" for i, j, same in reads)
    # output i reads axis j: wanted axis j is mapped axis of output i
    inverse = {j: (mapping.axes[i], "+" if same == (mapping.signs[i] == "+") else "-") for i, j, same in reads}
    order, turned = (",".join(inverse[k][part] for k in range(3)) for part in (0, 1))
    raise DataRejected(
        f"{where}: by the stated faces, {found}; each output must read its own axis; correct poses, or add --set axes={order} "
        f"--set signs={turned}"
    )
