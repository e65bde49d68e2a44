"""Check of the numbers of a record against the given unit of its output."""

import numpy as np

from inertial.arrays import Array
from schemas.errors import DataRejected
from schemas.units import STANDARD_GRAVITY_M_S2

LIKELY = (0.5, 2.0)
"""Median norm over gravity of a record in the unit given: bias and shaking by hand stay well below."""
SURE = 0.05
GRAVITY = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2, "mg": 1e3}
"""Size of gravity in the units that need no sensitivity."""
VOLTS_PER_G = (1e-3, 20.0)
"""Sensitivities of analog accelerometers: shock sensors to seismic ones."""
DOUBT = ": check"
"""End of a reason that is a guess."""
_NEAR_POWER, _FEWEST_COUNTS = 0.05, 60.0
"""Distance of the binary logarithm of a size from a whole number, and size, of means of counts."""
_MOST = 200_000
_BITS = (8, 10, 12, 14, 16, 18, 20, 24, 32)
_STEADY = 0.1
"""Half-width of the middle half of the norms over their median, below which it is the norm of gravity."""
_END, _OFTEN, _SELDOM = 1 / 16, 0.03, 0.005
"""Share of the range at its ends and to either side of its middle; share of the samples in each end, and in the middle: an axis
without force lies at both ends if its sign was lost, and in the middle if the converter's zero is there."""


def size_of(output: Array) -> float:
    """Size of gravity in a record (n, 3), as its median norm."""
    return float(np.median(np.linalg.norm(output[:_MOST], axis=1)))


def looks_like(size: float) -> str:
    """The unit without a sensitivity in which gravity has this size, within a factor of two; empty if there is none."""
    return next((unit for unit, gravity in GRAVITY.items() if LIKELY[0] < size / gravity < LIKELY[1]), "")


def unit_of(output: Array, size: float, *, means: bool = False) -> tuple[str, str]:
    """The probable unit of a record (n, 3) in which gravity has a size, and the reason; it ends in DOUBT where it is a guess.

    ``means``: whether the numbers are means of samples, which are not whole where the samples are counts.
    """
    integers = bool(np.all(output[:1000] == np.rint(output[:1000])))
    likely, power = looks_like(size), np.log2(max(size, 1e-300))
    of_two = size > _FEWEST_COUNTS and bool(abs(power - np.rint(power)) < _NEAR_POWER)
    if likely and not (integers and likely != "mg"):
        doubt = f", though whole numbers may be counts{DOUBT}" if integers else ""
        if means and of_two and abs(size - 2.0 ** np.rint(power)) < abs(size - GRAVITY[likely]):
            doubt = f", though means of counts are closer to {2.0 ** np.rint(power):g}{DOUBT}"
        return likely, f"its norm is {size:.5g}, gravity in {likely} is {GRAVITY[likely]:.5g}{doubt}"
    if integers:
        return "LSB", f"whole numbers with a norm of {size:.5g}"
    if of_two:
        return "LSB", f"its norm is {size:.5g}, close to a power of two: means of counts"
    if VOLTS_PER_G[0] <= size <= VOLTS_PER_G[1]:
        return "V", f"its norm is {size:.5g}, no size of gravity, but one of volts{DOUBT}"
    return "LSB", f"its norm is {size:.5g}, neither gravity nor volts{DOUBT}"


def unsigned_bits(output: Array) -> int:
    """Bits of signed words that were read as unsigned in a record of counts (n, 3): −1 reads as 65535; 0 if there are none.

    Shown by the norm, which is that of gravity only after 2^bits is subtracted from the upper half of the numbers; where the
    bias is large, by jumps over the range between neighbours, which are gone then.
    """
    x = output[:: max(1, len(output) // _MOST)]
    if not len(x) or np.any(x < 0.0) or np.any(x != np.rint(x)):
        return 0
    bits = next((b for b in _BITS if x.max() < 2.0**b), 0)
    if not bits or not np.any(x >= 2.0 ** (bits - 1)):
        return 0
    span = 2.0**bits
    ends = np.mean(x < _END * span), np.mean(x >= (1.0 - _END) * span)
    if min(ends) < _OFTEN or np.mean(np.abs(x - 0.5 * span) < _END * span) > _SELDOM:
        return 0
    signed = np.where(x >= 0.5 * span, x - span, x)
    parted = _jumps(x, 0.5 * span) > _OFTEN > 10.0 * _jumps(signed, 0.5 * span)
    return bits if parted or _scatter(signed) < _STEADY else 0


def _jumps(x: Array, size: float) -> float:
    """Share of neighbouring samples (n, 3) that are further apart than a size: words about zero jump by the whole range."""
    return float(np.mean(np.abs(np.diff(x, axis=0)).max(axis=1) > size)) if len(x) > 1 else 0.0


def _scatter(x: Array) -> float:
    """Half-width of the middle half of the norms of samples (n, 3) over their median."""
    low, middle, high = np.quantile(np.linalg.norm(x, axis=1), (0.25, 0.5, 0.75))
    return float(0.5 * (high - low) / middle) if middle > 0.0 else np.inf


def refuse_other_unit(output: Array, claimed: str, where: str, *, means: bool = False) -> tuple[str, ...]:
    """Refuse a record whose norm contradicts the unit; remarks if it is only unusual.

    Parameters
    ----------
    output : (n, 3) in the file's own numbers.
    claimed : the given unit.
    means : whether the numbers are means of samples: those of counts are not whole.
    """
    size = size_of(output)
    other = looks_like(size)
    if claimed in GRAVITY:
        if LIKELY[0] < size / GRAVITY[claimed] < LIKELY[1]:
            return ()
        advice = f"the unit looks like {other}, give --unit-of output={other}"
        if not other:
            advice = "numbers of a converter are LSB, of a voltmeter V or mV: --unit-of output=LSB|V|mV"
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g}, about {GRAVITY[claimed]:.5g} is needed if its unit is {claimed}; "
            f"{advice}"
        )
    close = next((unit for unit, gravity in GRAVITY.items() if abs(size / gravity - 1.0) < SURE), "")
    if claimed == "LSB":
        return _counts(output, size, close, where, may_be_parts=means and size > _FEWEST_COUNTS)
    volts = size * (1e-3 if claimed == "mV" else 1.0)
    if not VOLTS_PER_G[0] <= volts <= VOLTS_PER_G[1]:
        other = f"the unit looks like {other}" if other else "V and mV differ by a thousand"
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g} {claimed}, {VOLTS_PER_G[0]:g} to {VOLTS_PER_G[1]:g} V is what analog "
            f"accelerometers give at rest; {other}; correct --unit-of output=…"
        )
    if close:
        return (f"CHECK THE UNIT: the norm of the output is {size:.5g}, as gravity in {close}; {claimed} was given",)
    return ()


def _counts(output: Array, size: float, close: str, where: str, *, may_be_parts: bool) -> tuple[str, ...]:
    """As :func:`refuse_other_unit`, of counts; ``may_be_parts``: whether they need not be whole numbers."""
    integers = bool(np.all(output[:1000] == np.rint(output[:1000])))
    bits = unsigned_bits(output)
    if bits:
        half = 2 ** (bits - 1)
        raise DataRejected(
            f"{where}: signed words of {bits} bits were read without their sign: with {2 * half} subtracted from the values of "
            f"{half} and above the norm is steady, as gravity is, and without it is not; subtract {2 * half} from these values"
        )
    if close and not integers and not may_be_parts:
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g} and its values are not whole numbers, counts are needed if its "
            f"unit is LSB; the unit looks like {close}, give --unit-of output={close}"
        )
    if close:
        return (f"CHECK THE UNIT: the norm of the output is {size:.5g}, as gravity in {close}; LSB was given",)
    doubt = "CHECK THE UNIT: values within a few units of one another that are not whole numbers, but LSB was given"
    return (doubt,) if not integers and np.ptp(output[:1000]) < 8.0 else ()
