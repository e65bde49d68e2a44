"""The one question whether a probability passes a limit. What is no number neither passes nor fails: it decides nothing."""

import numpy as np
from numpy.typing import ArrayLike


def passes(probability: ArrayLike, above: float) -> bool | None:
    """Whether every probability is at least a limit; None where that cannot be told.

    One that is below the limit decides, whatever the others are. Without one, a probability that is no number (NaN) leaves the
    question open, and so do no probabilities at all.

    Parameters
    ----------
    probability : (...,), of so bad an agreement if the model is right
    above : limit, 0 … 1
    """
    values = np.asarray(probability, dtype=np.float64)
    if bool(np.any(values < above)):
        return False
    if values.size == 0 or not bool(np.all(values >= above)):
        return None
    return True
