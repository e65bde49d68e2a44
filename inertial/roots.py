"""The root of a function of one variable, without scipy.optimize: loading it takes a quarter of a second."""

from collections.abc import Callable

_TURNS = 100


def root(function: Callable[[float], float], low: float, high: float, *, within: float = 2e-12) -> float:
    """Where a function is zero between two values at which it has different signs, by Brent's method.

    Inverse quadratic interpolation, and halves of the interval where it gains less: R. P. Brent, Algorithms for Minimization
    Without Derivatives, 1973, chapter 4. The numbers are those of scipy.optimize.brentq.

    Parameters
    ----------
    within : absolute error of the root, beside the relative one of rounding

    Raises
    ------
    ValueError
        The function has the same sign at both ends, or no root is found.
    """
    before, now, across = low, high, 0.0
    at_before, at_now, at_across = function(before), function(now), 0.0
    if at_before == 0.0 or at_now == 0.0:
        return before if at_before == 0.0 else now
    if (at_before < 0.0) == (at_now < 0.0):
        raise ValueError(f"no change of sign between {low} and {high}")
    last = step = 0.0
    for _ in range(_TURNS):
        if at_before != 0.0 and (at_before < 0.0) != (at_now < 0.0):
            across, at_across = before, at_before
            last = step = now - before
        if abs(at_across) < abs(at_now):
            before, now, across = now, across, now
            at_before, at_now, at_across = at_now, at_across, at_now
        error = 0.5 * (within + 8.9e-16 * abs(now))
        half = 0.5 * (across - now)
        if at_now == 0.0 or abs(half) < error:
            return now
        tried = half
        if abs(last) > error and abs(at_now) < abs(at_before):
            tried = _interpolated((before, at_before), (now, at_now), (across, at_across))
        useful = tried is not half and 2.0 * abs(tried) < min(abs(last), 3.0 * abs(half) - error)
        last, step = (step, tried) if useful else (half, half)
        before, at_before = now, at_now
        now += step if abs(step) > error else (error if half > 0.0 else -error)
        at_now = function(now)
    raise ValueError(f"no root between {low} and {high}")


def _interpolated(before: tuple[float, float], now: tuple[float, float], across: tuple[float, float]) -> float:
    """The step from ``now`` to the zero of the line, or of the inverse parabola, through points and values."""
    if before[0] == across[0]:
        return -now[1] * (now[0] - before[0]) / (now[1] - before[1])
    first = (before[1] - now[1]) / (before[0] - now[0])
    second = (across[1] - now[1]) / (across[0] - now[0])
    return -now[1] * (across[1] * second - before[1] * first) / (second * first * (across[1] - before[1]))
