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
"""Probability of the kurtosis of normal noise below which the tails of the noise are called heavy.

Then a dwell is named only where such tails do not reach it, from about fifty standard deviations on; the others are listed as
left out. t3 tails under 1/f, 8 units: 25 of 50 lots name a dwell without it, 0 of 40 with it; of one or two units still 11 of 80.
"""

TOGETHER = 2.5
"""Standard errors by which the units must go together, dwell by dwell, before their common noise is reckoned with.

Table at rest ± 20 µrad: nothing named in 20 runs, with 8 of 10 without it.
"""

NAMED_BELOW = 1e-3
"""Probability of the chi-square, times the number of looks, below which something is named; beside the price."""

MATERIAL = 0.2
"""Share of the floor below which a significant effect is not named: remainders of imperfect drivers are of that size."""

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
