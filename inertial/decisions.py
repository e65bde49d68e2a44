"""The constants of the decisions of a diagnosis, each with its derivation or its operating characteristic.

Set once on simulated data with seeds of their own (`python benchmarks/worlds --seeds development`), never on those used for the
figures of the documentation (`--seeds judging`). `python benchmarks/characteristics.py --only NAME` prints the characteristic of
a constant on further seeds; three numbers are the decisions taken at half of it, at it and at twice as much, and every "of n"
has its 95 % interval there (0 of 4: [0, 0.6]; 4 of 4: [0.4, 1]).
"""

SHARE_STEP, LEAST_SHARE, LARGEST_SHARE = 8, -12, 36
"""Shares of 1/f and of random walk over the white variance: 0, or 10^(k/8) for k between the least and the largest.

Derived: the nearest step is within 7 % of K, inside the scatter of K over lots; the bounds are 3 % of the white variance, which
changes no result, and a wander with 180 times the standard deviation of the white noise. `python benchmarks/characteristics.py
--only SHARE_STEP --runs 10`: K of the fit over K of the device, median of ten lots (10 to 90 %), B 30: eight units K 2, 4, 8:
0.95 (0.80–1.18), 0.96 (0.82–1.03), 0.94 (0.87–1.01); one unit: 0.87 (0.45–1.26), 0.97 (0.76–1.21), 1.05 (0.93–1.21).
"""

OWN_SUSPECT, OWN_SHARES = 22.0, 20.0
"""Box-Pierce statistic of three lags from which a block's wander may be of another kind than the lot's; and the deviance by which
shares of 1/f and of random walk of its own must fit its residuals better than those of the lot.

Derived: chi-square of three degrees of freedom exceeds 22 with a probability of 7e-5, and of two exceeds 20 with one of 5e-5.
`python benchmarks/characteristics.py --only OWN_SHARES --runs 10`: 0 of 1680 axes of lots with one kind of noise have their own;
19 and 20 of 240 where 15 % jump by 150 µg, 200 and 900 s at a level.
"""

LOUDER_BELOW = 1e-4
"""Probability of the differences of the scatter of soaks, over units and axes, below which each soak has a noise of its own.

Derived: an F test of means over units and axes within each soak, by whose scatter the means are judged; equal soaks pass for
different in one lot of ten thousand. `python benchmarks/characteristics.py --only LOUDER_BELOW --runs 10`: 0 of 70 lots with
equal soaks have a noise for each soak, 10 of 10 whose fast noise grows by two between the soaks, and 10 of 10 by four.
The same test tells whether noise depends on the force along the axis: it does in 0 of 24 lots of eight other noises, and in 0 of
5 with a large effect (`tests/unit/inertial/estimation/test_force_noise.py`).
"""

PRIOR_BETTER = 4.0
"""Deviance by which different variances of units and axes must fit better than a common one.

Units spread 0.5–2: four prior degrees of freedom. `python benchmarks/decision_rates.py`, 16 or 20 lots of each world, seeds of
their own: equal units taken as different in 1 of 140 lots, units spread 0.5–2 in 16 of 16; t3 tails of white noise pass for
different units in 33 of 36 lots of eight.
"""

PRIOR_DOF = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""Prior degrees of freedom to try.

Derived: a variance has a mean above two only, and 256 is as good as a common variance for series of up to a hundred dwells.
`python benchmarks/characteristics.py --only PRIOR_DOF`: between two values of the grid the median of 200 draws loses 0.21 of the
deviance (95 % of them 1.07 at most) of the 4 that decide.
"""

BAD_DWELL = 1e-3
"""Probability over all dwells of a lot below which a dwell is left out: chi-square of three axes, 5.7 standard deviations.

`python benchmarks/decision_rates.py`, seeds of their own: a sound dwell left out in 1 of 156 lots of normal noise. A dwell off
by five times the noise about the record's mean is left out in 30 of 36 lots of eight units and 35 of 36 of one where 1/f
prevails, in 8 of 16 under white noise, where the limit itself is 5.7; by seven times in 20 of 20.
"""

MOST_BAD = 0.02
"""Largest share of the dwells that is left out.

Derived: normal noise loses a dwell in one of a thousand lots at :data:`BAD_DWELL`, so the share binds only where the noise has
heavy tails or most dwells of a lot are wrong. `python benchmarks/characteristics.py --only MOST_BAD`: of 12 lots each 0.08
dwells in the mean with normal noise and 1.4 with tails of t3 (6 at most), and the limit of 12 is reached in 0 of 12.
"""

COMMON = 0.01
"""Probability below which a dwell deviates in most units at once: then the pose is wrong, not the unit.

Derived: the median over the units exceeds it in sound dwells with the binomial probability that half of the units do, 3·10⁻⁴
with three units and 7·10⁻⁷ with eight. `python benchmarks/characteristics.py --only COMMON`: 142 and 0 of 500 000; a pose off by
three, four standard deviations of each of eight units is left to the poses in 46 and 99 %.
"""

HEAVY = 0.05
"""Probability of the kurtosis of normal noise below which adequacy is judged against the model's own residuals.

`python benchmarks/decision_rates.py`: 7 of 140 lots of normal noise; t3 tails of white noise in 72 of 72, and beside 1/f of B 30
(white 100 µg/√Hz, 10 s) in 29 of 36 lots of eight and 12 of 36 of one unit.
"""

TAILS = 0.2
"""Probability, before the data, that the noise of dwells has heavy tails (t of three degrees of freedom, any share of it).

`python benchmarks/characteristics.py --only TAILS --runs 4`, dwells named of those left out at half, at it, at twice as much:
noise of t3 in lots of eight 0, 0, 0 of 6, of one unit 1, 1, 1 of 1; a dwell off by 0.5 mg 4, 4, 4 of 4. More figures with
:data:`TAILS_REACH`.
"""

TAILS_REACH = 0.005
"""Probability, over the dwells of a run, that its noise reaches as far as a dwell, below which the dwell is named.

Set with the prior of the shares on drawn noise (normal, and t3 of 20 to 100 % of the variance). `python
benchmarks/decision_rates.py --first 5000`, 16 lots each, seeds of their own: t3 tails and no fault, a dwell named in 2 of 64. A
dwell off by five times the noise about the record's mean (5.5 to 9 standard deviations given its neighbours) named in 11 of the
13 left out with eight units (8 with equal probabilities of all shares), in 11 of 16 with one, in 7 of 8 under white noise.
Dwells that are not named are left out and listed.
"""

TOGETHER = 2.5
"""Standard errors by which the units must correlate, dwell by dwell, before their common noise is taken into account.

Table at rest ± 20 µrad: nothing named in 20 runs, with 8 of 10 without it. `python benchmarks/decision_rates.py`: seen in 16 of
16 such lots, and in 3 of 104 lots of eight units whose noise is their own.
"""

NAMED_BELOW = 3e-3
"""Probability of the chi-square, times the number of tests, below which a finding is reported; in addition to the price.

Derived: a Bonferroni bound, so that a search of noise of known covariance reports something in three of a thousand runs at most.
With a third of it single units of 40 positions, with effects of four times the noise, have no name in 22 of 50, with it in 11.
`python benchmarks/characteristics.py --only NAMED_BELOW --runs 20`: 0 of 600 below 0.001, 4 of 600 below 0.01, 32 of 600 below
0.1: half of the bound, because the looks are correlated.
"""

MATERIAL = 0.2
"""Share of the scatter between neighbouring dwells below which a significant finding is not reported: remainders of imperfect
drivers.

A share of the scatter and not of the whole floor: a walk of 4 µg/√s over 2.5 h raises the floor tenfold, but not such
remainders. For handling errors the size in the changed dwells counts. `python benchmarks/characteristics.py --only MATERIAL
--runs 4`, at half, at it, at twice as much: a drift, a warm-up and a cubic of size 1 named in the first step in 4, 4, 4 of 4
each, something in lots of K 4 without effect in 0, 0, 0 of 4.
"""

REMAINDER = 0.1
"""Share of the largest effect of inexact shape below which a handling error beside it counts as the remainder of the effect.

Only of effects with a nonlinear parameter or a memory: a polynomial of the force has the shape of its equation and leaves no
remainder. `python benchmarks/remainders.py --runs 2`: effects at 20 times the noise leave a remainder in 0 of 14 runs; a unit
that moved by 0.2 mrad beside a cubic of 10 times the noise is 0.13 and 0.16 of it, and would be lost beside a larger one if the
rule held for every effect. The one known case: the lag of a component, identified as `thermal_rate` of 30 µg, left 2 µg of a
`gain_step`.
"""

CLASS_WIDTH = 15.0
"""Difference of scores within which rivals are in one class.

Derived: at a separation D the difference of two chi-squares is normal with mean D and variance 4·D, so that the wrong one leads
by w with probability Φ(−√w) at most, at D = w. Ten: 8·10⁻⁴. Five: margin for errors of the drivers. `python
benchmarks/characteristics.py --only CLASS_WIDTH`: 827 of 10⁶ at ten, 60 of 10⁶ at fifteen.
"""

CLEAR_LEAD = 4.0
"""Difference of scores above which the best member of a class is recommended before a simpler one.

Derived, with the formula of :data:`CLASS_WIDTH`: the wrong one leads by four with a probability of Φ(−2), 2.3 %, at most.
`python benchmarks/characteristics.py --only CLEAR_LEAD --runs 10`: 45 357 of 2·10⁶.
"""

ADEQUATE_ABOVE = 0.05
"""Probability above which a model passes, compared with draws whose noise is estimated again.

Derived: the rank of a run among draws of the same noise is uniform, so that an adequate model fails in 5 % at most. 6 of 235
null runs fail. `python benchmarks/characteristics.py --only ADEQUATE_ABOVE`: with the draws ending early 799 of 20 000 fail.
"""

CERTAIN_BELOW = 1e-3
"""Corrected probability below which no draws are needed.

Derived: a Bonferroni bound like :data:`NAMED_BELOW`; with heavy tails, where the F distribution is not exact, its square.
`python benchmarks/characteristics.py --only CERTAIN_BELOW --runs 20`: 0 of 600 runs of noise are below it.
"""

DRAWS, ENOUGH = 99, 8
"""Largest number of draws of noise, and the number of draws worse than the run that ends the drawing.

Derived: Besag & Clifford, Biometrika 78 (1991) 301: eight worse draws of 99 give a probability of 0.09, clearly above the limit.
`python benchmarks/characteristics.py --only DRAWS`: a run whose probability is 0.005, 0.01, 0.02, 0.03, 0.05, 0.1 is called
inadequate in 100, 98, 86, 66, 27, 1 % of 5000 each.
"""

CONFIRMED = 2.05
"""Standard errors by which a fresh run must reproduce a predicted change.

Derived: 2.0 % of a normal distribution. `python benchmarks/characteristics.py --only CONFIRMED`: a wrong effect in 2.0 % of 500
000 draws, a true one in 100, 90 and 48 % where its standard error is 0.15, 0.3 and 0.5. In runs, of 1197 wrong effects 17 are
confirmed, of 828 true ones of two floors 826; with another random walk on the day of the fresh run see `python
benchmarks/worlds loop --world B30_then_K4` and the three others. The fall of an error, on a fresh run or on dwells left out, has
to exceed as many of its own standard errors: for true effects of two floors it is at least four of them on a fresh run with the
noise of the first, and one to three for a curvature over temperature on a day with the walk of K 4 after one of B 30.
"""

REFUTED = 0.5
"""Reproduced part of a predicted change below which, with two standard errors, the effect is refuted.

Derived: a true effect of standard error e is refuted with probability Φ(−2 − 0.5/e). `python benchmarks/characteristics.py
--only REFUTED`: 0, 0, 0.01, 0.13 % of 500 000 draws at e of 0.05, 0.15, 0.3, 0.5, a wrong one 100, 91, 37, 16 %. In runs no true
effect of 936.
"""

BLOCKS = 6
"""Number of stretches of time that are left out in turn.

A stretch has to be longer than the time over which the noise predicts itself, and the rest of the record has to determine the
model; a sixth of a record of three soaks is half a soak. Measured with :data:`LEFT_OUT`, `python benchmarks/worlds loop`: wrong
effects 5 of 1125.
"""

LEFT_OUT = 4.0
"""Log density, on stretches left out, that an effect must gain to be confirmed without a fresh run.

Wrong effects 5 of 1125; true ones of two floors 108 of 108 with eight units, 343 of 360 with one, by this alone. Dwells left out
of one run share its faults, so every kind of them that can judge has to agree, and the run must show no fault: `python
benchmarks/worlds loop --first 3300 --runs 1` counts 22 of 25 true ones (24 by the density alone) and 0 of 45 wrong ones.
"""

RISES = 0.005
"""Share by which the error on dwells left out may rise with an effect that is recommended: rounding and chance only.

`python benchmarks/characteristics.py --only RISES --runs 2`, eight units: a true effect of size 1 in 0 of 10; a wrong one rises
by more than half of it in 17 of 17, by more than it in 13 of 17, by more than twice as much in 9 of 17.
"""

JUMPS_RARE = 9.2
"""Price, in chi-square, of a jump of a single axis, and of every further one that takes the place of an effect with others.

Derived: 2·ln 100, an axis in a hundred jumps by itself. `python benchmarks/worlds noises --runs 10`.
"""

LESS_FLICKER, LESS_WALK = 0.25, 1.0 / 30.0
"""Fractions of 1/f and random walk at which candidates are tested again: a drift hidden in the walk is detected there.

`python benchmarks/characteristics.py --only LESS_WALK --runs 4` (`LESS_FLICKER`), at half, at it, at twice as much: a drift and
a warm-up of size 1 named in the first step in 4, 4, 4 of 4 each, something in lots of K 4 without effect (`LESS_WALK`) in 0, 0,
0 of 4.
"""

RIVAL_NEAR = 60.0
"""Score behind the best above which a rival of a class is not judged with its own noise.

It is compared at the noise of the best, and counts there as much more as the best effect's score is larger than at its own.
`python benchmarks/characteristics.py --only RIVAL_NEAR --runs 4`, at half, at it, at twice as much: the truth in the class of a
square of the temperature of size 2 and of a warm-up of size 1 in 4, 4, 4 of 4 each; without the factor a step after four soaks
in one direction is not in the class of the cubic that takes its place (`python benchmarks/investigate.py --scene "step one way"
--first 3`).
"""

AXES_DIFFER = 30.0
"""Chi-square that one value of a nonlinear parameter per axis must reduce beyond one value for all.

`python benchmarks/characteristics.py --only AXES_DIFFER --runs 6`, one value per axis taken at half, at it, at twice as much:
with an effect of one common value (warm-up of size 2 and 10, kink of size 10) in 0, 0, 0 of 18; of effects that are not there in
7, 4, 0 of 18, where it gives a wrong effect two further coefficients to pay for.
"""

FOLD_BLIND = 4.0
"""Factor by which a fold's expected errors may exceed those of a prediction from the neighbours alone.

Above it the other dwells do not determine the model: with one of three soaks left out a curvature over temperature is
undetermined. `python benchmarks/characteristics.py --only FOLD_BLIND --runs 4`: a curvature over temperature judged by soaks
left out at half, at it, at twice as much, with three soaks in 0, 0, 0 of 4 lots, with five soaks in 0, 4, 4 of 4.
"""

UNITS_TOGETHER = 3.0
"""Standard errors by which units must correlate before the distance of two rivals counts their noise as common.

`python benchmarks/characteristics.py --only UNITS_TOGETHER --runs 20`, taken as common at half, at it, at twice as much: units
with noise of their own in 5, 3, 0 of 20 lots (1/f lets a correlation scatter more than white noise does; the promised separation
is then too small), a table at rest ± 20 µrad in 20, 19, 16 of 20.
"""

UNEXPLAINED = 0.5
"""Share of the floor below which a smooth dependence is ignored.

`python benchmarks/characteristics.py --only UNEXPLAINED --runs 6`, recorded quantities that are large enough at half, at it, at
twice as much: noise alone, and K 4, in 24, 0, 0 of 48 each; a square of the temperature of size 1 in 24, 24, 0 of 48, which are
those that vary with the soaks.
"""

CURVE_AHEAD, CURVE_SHARE = 40.0, 0.15
"""Penalised chi-square by which a curve of one driver must be better than an effect to take its place (half of it for two
effects), and the same as a share of the curve's gain; an effect beside the curve is kept by as much. Known physics has priority.

`python benchmarks/characteristics.py --only CURVE_AHEAD --runs 4` (`CURVE_SHARE`), at half, at it, at twice as much: a curve
preferred to a cubic of size 2, a warm-up of size 1, two effects, and to what imitates a bump of no catalogue in 0, 0, 0 of 4 lots
each.
A curve that takes the place of noise needs half of it: its gain and price are twice the log evidence. Random walks over pauses
reach −91 to −5 in 11 lots, a daily course and courses of 1.5 times the noise beside a walk 39 to 163 in 7.
"""

STEPS_UNEVEN = 5.0
"""Multiple of the sampling spread of a scatter above which scatters of dwells differ for another reason.

`python benchmarks/characteristics.py --only STEPS_UNEVEN --runs 3`, units called coarse at half, at it, at twice as much: steps
of five times the noise of a sample in 24, 24, 24 of 24; steps of once and twice the noise, no steps and t3 tails in 0 of 96 at
each value.
"""

STEPS_FOLLOW = 0.7
"""Share of the variances' own variance that the place between two steps explains, from which on the steps are the cause.

`python benchmarks/characteristics.py --only STEPS_FOLLOW --runs 3`, units called coarse at half, at it, at twice as much: steps
of five times the noise of a sample in 24, 24, 0 of 24 (a share above one is never reached); steps of once and twice the noise,
no steps and t3 tails in 0 of 96 at each value.
"""

FOREIGN_UNIT, FOREIGN_LOT = 2e-3, 1e-2
"""Probability, over all effects, below which a unit does not fit its family, and a lot widens its prior.

`python benchmarks/priors.py --characteristic --units 200 --seed 77`, lots of eight, at half, at it, at twice as much: units of a
normal family that do not fit it 1, 3, 5 of 1600, of one with t5 tails 2, 6, 11 of 1600; units off by eight spreads told in 200,
200, 200 of 200; lots of a normal family that are widened 1, 4, 6 of 200, lots off by three spreads 200, 200, 200 of 200.
"""
