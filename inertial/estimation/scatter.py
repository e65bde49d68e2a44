"""Test whether groups of measurements differ in scatter; used for soaks, classes of force and white noise of samples."""

import numpy as np

from inertial.arrays import Array
from inertial.decisions import LOUDER_BELOW
from inertial.distributions import f_tail


def difference_p(sizes: Array) -> float:
    """Probability that groups of equal scatter differ as much, by an F test of their mean log variances over units and axes.

    Parameters
    ----------
    sizes : (blocks, groups), logarithms of variances; of at least two blocks and two groups
    """
    blocks, groups = sizes.shape
    each = sizes - sizes.mean(axis=1, keepdims=True)
    between = blocks * float(np.sum(each.mean(axis=0) ** 2)) / (groups - 1)
    dof = (blocks - 1) * (groups - 1)
    inside = float(np.sum((each - each.mean(axis=0)) ** 2)) / dof
    return float(f_tail(between / max(inside, 1e-12), groups - 1, dof))


def differ(sizes: Array) -> bool:
    """Whether groups differ in scatter, from logarithms (blocks, groups)."""
    return difference_p(sizes) < LOUDER_BELOW
