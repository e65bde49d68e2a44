"""The constants of the decisions of a diagnosis, with the effect of each.

Set once on simulated data with seeds of their own (`python benchmarks/worlds --seeds development`), never on those used for the
figures of the documentation (`--seeds judging`).
"""

SHARE_STEP, LEAST_SHARE, LARGEST_SHARE = 8, -12, 36
"""Shares of 1/f and of random walk over the white variance: 0, or 10^(k/8) for k between the least and the largest.

72 dwells, 8 units: K of 2, 4 and 8 µg/√s beside B 30 µg are recovered within −24 … +14, ± 12 and ± 8 %; of one unit, 4 within ±
40 %.
"""

PRIOR_BETTER = 4.0
"""Deviance by which different variances of units and axes must fit better than a common one.

Units spread 0.5–2: four prior degrees of freedom. `python benchmarks/decision_rates.py`, 16 or 20 lots of each world, seeds of
their own: equal units taken as different in 1 of 140 lots, units spread 0.5–2 in 16 of 16; t3 tails of white noise pass for
different units in 33 of 36 lots of eight.
"""

PRIOR_DOF = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""Prior degrees of freedom to try."""

BAD_DWELL = 1e-3
"""Probability over all dwells of a lot below which a dwell is left out: chi-square of three axes, 5.7 standard deviations.

`python benchmarks/decision_rates.py`, seeds of their own: a sound dwell left out in 1 of 156 lots of normal noise. A dwell off by
five times the noise about the record's mean is left out in 30 of 36 lots of eight units and 35 of 36 of one where 1/f prevails,
in 8 of 16 under white noise, where the limit itself is 5.7; by seven times in 20 of 20.
"""

MOST_BAD = 0.02
"""Largest share of the dwells that is left out."""

COMMON = 0.01
"""Probability below which a dwell deviates in most units at once: then the pose is wrong, not the unit."""

HEAVY = 0.05
"""Probability of the kurtosis of normal noise below which adequacy is judged against the model's own residuals.

`python benchmarks/decision_rates.py`: 7 of 140 lots of normal noise; t3 tails of white noise in 72 of 72, and beside 1/f of B 30
(white 100 µg/√Hz, 10 s) in 29 of 36 lots of eight and 12 of 36 of one unit.
"""

TAILS = 0.2
"""Probability, before the data, that the noise of dwells has heavy tails (t of three degrees of freedom, any share of it)."""

TAILS_REACH = 0.005
"""Probability, over the dwells of a run, that its noise reaches as far as a dwell, below which the dwell is named.

Set with the prior of the shares on drawn noise (normal, and t3 of 20 to 100 % of the variance). `python
benchmarks/decision_rates.py --first 5000`, 16 lots each, seeds of their own: t3 tails and no fault, a dwell named in 2 of 64. A
dwell off by five times the noise about the record's mean (5.5 to 9 standard deviations given its neighbours) named in 11 of the
13 left out with eight units (8 with equal probabilities of all shares), in 11 of 16 with one, in 7 of 8 under white noise. Dwells
that are not named are left out and listed.
"""

TOGETHER = 2.5
"""Standard errors by which the units must correlate, dwell by dwell, before their common noise is taken into account.

Table at rest ± 20 µrad: nothing named in 20 runs, with 8 of 10 without it. `python benchmarks/decision_rates.py`: seen in 16 of
16 such lots, and in 3 of 104 lots of eight units whose noise is their own.
"""

NAMED_BELOW = 1e-3
"""Probability of the chi-square, times the number of tests, below which a finding is reported; in addition to the price."""

MATERIAL = 0.2
"""Share of the scatter between neighbouring dwells below which a significant finding is not reported: remainders of imperfect
drivers.

A share of the scatter and not of the whole floor: a walk of 4 µg/√s over 2.5 h raises the floor tenfold, but not such remainders.
For handling errors the size in the changed dwells counts.
"""

REMAINDER = 0.1
"""Share of the largest effect of inexact shape below which a handling error beside it counts as the remainder of the effect.

Only of effects with a nonlinear parameter or a memory: a polynomial of the force has the shape of its equation and leaves no
remainder. `python benchmarks/remainders.py`, 2 runs of 10 worlds: no remainder at 20 times the noise; a unit that moved by
0.2 mrad beside a cubic of 10 times the noise is 0.13 and 0.16 of it, and would be lost beside a larger one if the rule held for
every effect. The one known case: the lag of a component, identified as `thermal_rate` of 30 µg, left 2 µg of a `gain_step`.
"""

CLASS_WIDTH = 15.0
"""Difference of scores within which rivals are in one class.

Ten: the wrong one of two leads with probability Φ(−√10) = 8e-4. Five: margin for errors of the drivers.
"""

ADEQUATE_ABOVE = 0.05
"""Probability above which a model passes, compared with draws whose noise is estimated again: 6 of 235 null runs fail."""

CERTAIN_BELOW = 1e-3
"""Corrected probability below which no draws are needed."""

DRAWS, ENOUGH = 99, 8
"""Largest number of draws of noise, and the number of draws worse than the run that ends the drawing."""

CONFIRMED = 2.05
"""Standard errors by which a fresh run must reproduce a predicted change.

Of 1197 wrong effects 17 are confirmed (1.4 %), of 828 true ones of two floors 826.
"""

REFUTED = 0.5
"""Reproduced part of a predicted change below which, with two standard errors, the effect is refuted; no true effect in 936."""

BLOCKS = 6
"""Number of stretches of time that are left out in turn."""

LEFT_OUT = 4.0
"""Log density, on stretches left out, that an effect must gain to be confirmed without a fresh run.

Wrong effects 5 of 1125; true ones of two floors 108 of 108 with eight units, 343 of 360 with one.
"""

RISES = 0.005
"""Share by which the error on dwells left out may rise with an effect that is recommended: rounding and chance only."""

LESS_FLICKER, LESS_WALK = 0.25, 1.0 / 30.0
"""Fractions of 1/f and random walk at which candidates are tested again: a drift hidden in the walk is detected there."""

RIVAL_NEAR = 60.0
"""Score behind the best above which a rival of a class is not judged with its own noise.

It is compared at the noise of the best, and counts there as much more as the best effect's score is larger than at its own.
"""

AXES_DIFFER = 30.0
"""Chi-square that one value of a nonlinear parameter per axis must reduce beyond one value for all."""

FOLD_BLIND = 4.0
"""Factor by which a fold's expected errors may exceed those of a prediction from the neighbours alone.

Above it the other dwells do not determine the model: with one of three soaks left out a curvature over temperature is
undetermined.
"""

UNITS_TOGETHER = 3.0
"""Standard errors by which units must correlate before the distance of two rivals counts their noise as common.

At half of it, at it and at twice as much a cubic of size 2 is named rightly in 2 of 2 runs each.
"""

UNEXPLAINED = 0.5
"""Share of the floor below which a smooth dependence is ignored."""

DECISIVE = 0.2
"""Share of its gain by which a curve must exceed the chosen effects to end the search."""

OTHERS, OTHERS_SHARE = 60.0, 0.1
"""Smallest penalised chi-square of an effect beside a curve, and the same as a share of the gain of the curve."""

DOUBT = {0: 0.0, 1: 40.0, 2: 20.0}
"""Penalised chi-square by which a curve must exceed so many effects: known physics has priority."""

DOUBT_MEMORY = 0.5
"""The same, as a share, for an effect with memory: a curve over time can follow any memory of one run."""

DOUBT_SHARE = 0.15
"""Share of the gain of a curve that one effect must leave unexplained before the curve is preferred."""

STEPS_UNEVEN = 5.0
"""Multiple of the sampling spread of a scatter above which scatters of dwells differ for another reason."""

STEPS_FOLLOW = 0.7
"""Share of the variances' own variance that the place between two steps explains, from which on the steps are the cause."""
