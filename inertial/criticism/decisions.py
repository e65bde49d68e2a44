"""The numbers that decide what a diagnosis says, with what each of them does.

Set once on simulated worlds with seeds of their own (`python benchmarks/worlds --seeds development`), and never on those that
the figures of the documentation are measured with (`--seeds judging`).
"""

SHARE_STEP, LEAST_SHARE, LARGEST_SHARE = 8, -12, 36
"""Shares of 1/f and of random walk over the white variance: 0, or 10^(k/8) for k between the least and the largest.

72 dwells, 8 units: K of 2, 4 and 8 µg/√s beside B 30 µg come back within −24 … +14, ± 12 and ± 8 %; of one unit, 4 within ± 40 %.
"""

PRIOR_BETTER = 4.0
"""Deviance by which variances that differ between units and axes must fit better than one for all.

Equal units: one variance, no power lost. Units spread 0.5–2: four prior degrees of freedom.
"""

PRIOR_DOF = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""Prior degrees of freedom that are tried."""

BAD_DWELL = 1e-3
"""Probability over all dwells of a lot below which a dwell is taken out: chi-square of three axes, 5.7 standard deviations.

No dwell in 240 Gaussian runs. Half of the dwells that are five standard deviations off, all that are eight.
"""

MOST_BAD = 0.02
"""Share of the dwells that is taken out at the most."""

COMMON = 0.01
"""Probability below which a dwell stands out in most units at once: then it is the pose, not the unit."""

HEAVY = 0.05
"""Probability of the kurtosis of normal noise below which adequacy is judged against the model's own residuals."""

TAILS = 0.2
"""Probability, before the data, that the noise of dwells has heavy tails (t of three degrees of freedom, any share of it)."""

TAILS_REACH = 0.005
"""Probability, over the dwells of a run, that its noise reaches as far as a dwell, below which the dwell is named.

Synthetic noise, 150 runs of one unit, 50 of eight. t3 tails of 20, 35, 60, 100 % of the variance and no fault: a dwell is named in
3, 4, 4, 1 % of the runs of one unit, in 4, 6, 0, 0 % of eight. Normal noise with a dwell 7, 8, 10 standard deviations off (given its
neighbours) in a random direction: named in 80, 93, 98 %, with eight units in 84, 94, 98 %. Five times the noise about the record's
mean is 5.5 to 9 of these. Dwells that are not named are left out and listed.
"""

TOGETHER = 2.5
"""Standard errors by which the units must go together, dwell by dwell, before their common noise is reckoned with.

Table at rest ± 20 µrad: nothing named in 20 runs, with 8 of 10 without it.
"""

NAMED_BELOW = 1e-3
"""Probability of the chi-square, times the number of looks, below which something is named; beside the price."""

MATERIAL = 0.2
"""Share of the scatter between neighbouring dwells below which nothing significant is named: remainders of imperfect drivers.

Of the scatter and not of the whole floor: a walk of 4 µg/√s over 2.5 h raises the floor tenfold, and no such remainder with it.
Of handling the size counts in the dwells that it changes.
"""

REMAINDER = 0.1
"""Share of the largest effect of inexact shape below which what handling does beside it counts as what the effect leaves over.

Only of effects with a nonlinear parameter or a memory: a polynomial of the force has the shape of its equation and leaves
nothing over. `python benchmarks/remainders.py`, 2 runs of 10 worlds: nothing left over at 20 times the noise; a unit that moved by
0.2 mrad beside a cubic of 10 times the noise is 0.13 and 0.16 of it, and would be lost beside a larger one if the rule held for
every effect. The one case known: the lag of a part, found as `thermal_rate` of 30 µg, left 2 µg of a `gain_step` in one unit.
"""

TOLD_APART = 15.0
"""Difference of scores within which rivals stand in one class.

Ten: the wrong one of two leads with probability Φ(−√10) = 8e-4. Five: room for drivers that are not read exactly.
"""

ADEQUATE_ABOVE = 0.05
"""Probability above which a model passes, against draws whose noise is estimated again: 6 of 235 null runs fail."""

CERTAIN_BELOW = 1e-3
"""Charged probability below which no draw is needed."""

DRAWS, ENOUGH = 99, 8
"""Draws of noise at the most, and how many that are worse than the run end the drawing."""

CONFIRMED = 2.05
"""Standard errors by which a predicted change must come again on a fresh run.

Of 1197 wrong effects 17 are confirmed (1.4 %), of 828 right ones of two floors 826.
"""

REFUTED = 0.5
"""Part of a predicted change below which, with two standard errors, it is told to be not there; no right effect in 936."""

BLOCKS = 6
"""Stretches of time that are left out in turn."""

LEFT_OUT = 4.0
"""Log density, on stretches left out, that an effect must gain to be confirmed without a fresh run.

Wrong effects 5 of 1125; right ones of two floors 108 of 108 with eight units, 343 of 360 with one.
"""

RISES = 0.005
"""Share by which the error on dwells left out may rise with an effect that is recommended: rounding and chance, no more."""

LESS_FLICKER, LESS_WALK = 0.25, 1.0 / 30.0
"""Parts of 1/f and of random walk at which candidates are looked at once more: a drift hidden in the walk comes up there."""

RIVAL_NEAR = 60.0
"""Score behind the best, at the noise of the best, beyond which a rival of a class is not judged with its own noise."""

AXES_DIFFER = 30.0
"""Chi-square that one value of a nonlinear parameter per axis must take off beyond one value for all."""

FOLD_BLIND = 4.0
"""Factor by which a fold's expected errors may exceed those of a prediction from the neighbours alone.

Beyond, the other dwells do not determine the model: with one of three soaks left out no function of temperature is bent.
"""

UNITS_TOGETHER = 3.0
"""Standard errors by which units must go together before the distance of two rivals counts their noise as shared."""

UNEXPLAINED = 0.5
"""Share of the floor below which a smooth dependence is left alone."""

DECISIVE = 0.2
"""Share of what a curve brings by which it must beat the effects chosen so far to end the search for more."""

OTHERS, OTHERS_SHARE = 60.0, 0.1
"""Penalised chi-square that an effect must bring beside a curve to stay, and the same as a share of what the curve brings."""

DOUBT = {0: 0.0, 1: 40.0, 2: 20.0}
"""Penalised chi-square by which a curve must beat so many effects: physics that is known is believed first."""

DOUBT_MEMORY = 0.5
"""The same, as a share, for an effect with memory: a curve over time follows any memory of one run."""

DOUBT_SHARE = 0.15
"""Share of what a curve explains that one effect must leave over before the curve is believed instead."""

STEPS_UNEVEN = 5.0
"""Times the spread of a scatter from so many samples, beyond which scatters of dwells differ for another reason."""

STEPS_FOLLOW = 0.7
"""Share of the variances' own variance that the place between two steps explains, from which on it is the steps."""
