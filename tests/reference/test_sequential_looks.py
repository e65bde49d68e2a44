"""A closed loop looks at its data again and again: how often noise makes the wrong rival stand alone at any of the looks."""

import numpy as np

from inertial.criticism.classes import CLASS_WIDTH

LOOKS, DWELLS, MORE, UNITS = 6, 72, 8, 4000


def test_six_looks_leave_the_wrong_rival_alone_in_less_than_one_run_of_a_thousand(rng):
    true = [rng.standard_normal(size) for size in (DWELLS, *[MORE] * (LOOKS - 1))]
    wrong = [
        r * x + np.sqrt(1.0 - r**2) * rng.standard_normal(x.size) for r, x in zip([0.98, *[0.9] * 5], true, strict=True)
    ]
    size = np.sqrt(20.0 / np.sum(true[0] ** 2))  # χ² of 60 in three blocks at the first look
    noisy = [size * x + rng.standard_normal((UNITS, 3, x.size)) for x in true]
    ended, misled = np.zeros(UNITS, dtype=bool), 0
    for look in range(1, LOOKS + 1):
        y, a, b = (np.concatenate(parts[:look], axis=-1) for parts in (noisy, true, wrong))
        lead = np.sum((y @ b) ** 2 / np.sum(b**2) - (y @ a) ** 2 / np.sum(a**2), axis=-1)
        misled += int(np.count_nonzero((lead > CLASS_WIDTH) & ~ended))
        ended |= np.abs(lead) > CLASS_WIDTH
    assert misled <= 4
    assert np.mean(ended) > 0.2
