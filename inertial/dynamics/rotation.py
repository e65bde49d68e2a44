"""A device turned at a constant rate in gravity: bias, scale, misalignment and effects, delay of the encoder, place of masses.

The output of axis i is bᵢ + Σⱼ Mᵢⱼ·fⱼ and the terms of effects, with the force f at the angle of the encoder's reading turned on
by rate times delay, and the acceleration of the place r in the fixture, α×r + ω×(ω×r). All axes are fitted together: the delay
of each axis of the table, the place and the errors of the angle in each sweep are common to them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2, f, norm, t

from inertial.arrays import Array
from inertial.dynamics.missing_effects import ADEQUATE_P, FOLDS, NamedFit
from inertial.dynamics.rotation_effects import EFFECTS
from inertial.dynamics.rotations import Nodes, Rotations, mean
from inertial.dynamics.wander import wander
from inertial.errors import NotIdentified
from inertial.noise.flicker import flicker_kernel

HARMONICS = 5  # waves a turn that are no noise: every effect has some of them that bias, matrix, K2 and K3 do not have
PASSES = 3  # of the delay, by which the angles are turned on, and of the matrix, which the place acts through
PLACE_M = 0.5  # standard deviation of the place of a proof mass before the test: less than the table is large
FEWEST_NOISE = 20  # degrees of freedom of the noise


@dataclass(frozen=True)
class RotationFit(NamedFit):
    """Bias, matrix, delays, place and the effects of a model; ``names`` are those of the ``value`` (p,) with its covariance.

    Names are ``bias_x``, ``matrix_xy`` (output x, force y; g/g), ``delay_outer`` and ``delay_inner`` in s where the axis turns,
    ``place_x`` in m of the fixture, ``second_order_x`` and so on for each axis, ``level_0`` for effects of the table.

    chi_square, dof : of what the model leaves in waves of up to five a turn, and at rest, by the noise of all other waves
    residuals : (n, axes), g
    """

    effects: tuple[str, ...] = ()

    def of_function(self, slope: dict[str, float]) -> float:
        """Standard uncertainty of a function by its derivatives over coefficients."""
        row = np.array([slope.get(name, 0.0) for name in self.names])
        return float(np.sqrt(row @ self.covariance @ row))

    def of_effect(self, effect: str) -> list[str]:
        """Names of the coefficients of an effect."""
        return [name for name in self.names if name.rsplit("_", 1)[0] == effect]


@dataclass(frozen=True)
class RotationData:
    """Outputs (n, axes) of a unit in g over points, and the standard uncertainty (n, axes) of each mean by white noise, g."""

    points: Rotations
    output: Array
    white: Array
    letters: tuple[str, ...]

    @cached_property
    def _kernel(self) -> Array:
        return flicker_kernel(self.points.time)

    @cached_property
    def _free(self) -> Array:
        """Columns (n, k) that may take any value and are no noise: waves of each sweep, and each point at rest."""
        p, columns = self.points, list[Array]()
        angle, orders = Nodes.of(p).angle, range(HARMONICS + 1)
        waves = [mean(wave(order * angle)) for order in orders for wave in (np.cos, np.sin) if order or wave is np.cos]
        for sweep in np.unique(p.sweep[p.turning]):
            columns += [np.where(p.sweep == sweep, wave, 0.0) for wave in waves]
        return np.column_stack([*columns, *np.eye(len(p.time))[~p.turning]])

    @cached_property
    def _noise(self) -> list[tuple[Array, Array, float, float]]:
        """For each axis: root of the covariance of its outputs, whitened free columns, squares beside these, Student's ν."""
        rest = len(self.points.time) - self._free.shape[1]
        if rest < FEWEST_NOISE:
            raise NotIdentified(
                f"rotation: {rest} points beside the waves of a turn, {FEWEST_NOISE} are needed; raise bins"
            )
        out: list[tuple[Array, Array, float, float]] = []
        for k in range(self.output.shape[1]):
            known = np.diag(self.white[:, k] ** 2)
            found = wander(self._free, self.output[:, k], known, self._kernel)
            root = np.asarray(np.linalg.cholesky(known + found.variance * self._kernel), dtype=np.float64)
            free, whitened = (solve_triangular(root, part, lower=True) for part in (self._free, self.output[:, k]))
            left = whitened - free @ np.linalg.lstsq(free, whitened, rcond=None)[0]
            # how well the noise is known: white noise by many samples, wander by the waves beside the fitted ones
            share = found.variance * float(np.mean(np.diag(self._kernel)))
            part = share / (share + float(np.mean(self.white[:, k] ** 2)))
            dof = 2.0 / max((part * found.error / max(found.variance, 1e-300)) ** 2, 2.0 / rest)
            out.append((root, free, float(left @ left), min(dof, float(rest))))
        return out

    @cached_property
    def noise_dof(self) -> float:
        """Degrees of freedom of the noise of the axis where it is known least."""
        return min(noise[3] for noise in self._noise)

    @cached_property
    def noise_scale(self) -> tuple[float, float, int]:
        """Variance of whitened outputs by waves beside the fitted ones, the squares there, and the number of free columns."""
        rest = len(self._noise) * (len(self.points.time) - self._free.shape[1])
        total = sum(noise[2] for noise in self._noise)
        return total / rest, total, len(self._noise) * self._free.shape[1]

    def white_rows(self, columns: Array) -> Array:
        """Columns (n, axes, m), or outputs (n, axes), with the covariance of the unit matrix: (axes·n, m) or (axes·n,)."""
        parts = [solve_triangular(noise[0], columns[:, k], lower=True) for k, noise in enumerate(self._noise)]
        return np.concatenate(parts)

    @cached_property
    def model(self) -> "RotationModel":
        """The model without effects of its own, at the delay and the matrix of the fit with K2 and K3."""
        delay, matrix = np.zeros(2), np.eye(3)[: len(self.letters)]
        for _ in range(PASSES):
            made = RotationModel(self, delay, matrix)
            fit = made.fit(("second_order", "third_order"))
            delay = np.array([fit.of(n)[0] if n in fit.names else 0.0 for n in ("delay_outer", "delay_inner")])
            matrix = np.array([[fit.of(f"matrix_{a}{b}")[0] for b in "xyz"] for a in self.letters])
        return RotationModel(self, delay, matrix)


class RotationModel:
    """Linear models about a delay (2,) in s, outer and inner, and a matrix (axes, 3) in g/g."""

    def __init__(self, data: RotationData, delay: Array, matrix: Array) -> None:
        self.data, self._delay, self._matrix = data, delay, matrix
        self._at = Nodes.of(data.points.later(delay))
        self._columns: dict[str, tuple[list[str], Array, Array]] = {}
        self._target = data.white_rows(data.output)
        self._base = self._whitened(*self._base_columns())
        self._errors = self._whitened(*self._error_columns())

    def _whitened(self, names: list[str], columns: Array) -> tuple[list[str], Array, Array]:
        return names, columns, self.data.white_rows(columns)

    def _each_axis(self, name: str, term: Array) -> tuple[list[str], Array]:
        """Columns (n, axes, axes) of a term (n, axes) with one coefficient for each axis."""
        letters = self.data.letters
        return [f"{name}_{a}" for a in letters], term[:, :, None] * np.eye(len(letters))

    def _seen(self, force: Array) -> Array:
        """Outputs (n, axes, m) of forces (n, 3, m) by the matrix."""
        return np.einsum("ij,njm->nim", self._matrix, force)

    def _base_columns(self) -> tuple[list[str], Array]:
        at, count = self._at, len(self.data.letters)
        force, slope = mean(at.force), mean(at.slope)
        made = [self._each_axis("bias", np.ones((len(force), count)))]
        for j, axis in enumerate("xyz"):
            names, columns = self._each_axis("matrix", np.repeat(force[:, [j]], count, axis=1))
            made.append(([f"{name}{axis}" for name in names], columns))
        rate = at.points.rate
        for name, turning in (("delay_outer", at.points.inner_turns == 0), ("delay_inner", at.points.inner_turns > 0)):
            if np.any(rate[turning]):
                late = (np.where(turning, rate, 0.0)[:, None] * slope)[..., None]
                made.append(([name], self._seen(late)))
        made.append(([f"place_{a}" for a in "xyz"], self._seen(mean(at.radial()))))
        return [n for names, _ in made for n in names], np.concatenate([c for _, c in made], axis=-1)

    def _error_columns(self) -> tuple[list[str], Array]:
        """Errors of the angle in each sweep, in standard deviations."""
        p, slope = self.data.points, mean(self._at.slope)
        each = np.concatenate(
            [np.where((p.sweep == s)[:, None], p.uncertain, 0.0) for s in np.unique(p.sweep[p.turning])], axis=1
        )
        columns = self._seen(slope[:, :, None] * each[:, None, :])
        return [f"@{k}" for k in range(columns.shape[-1])], columns

    def _of(self, effect: str) -> tuple[list[str], Array, Array]:
        if effect not in self._columns:
            term = mean(EFFECTS[effect].columns(self._at))
            if EFFECTS[effect].of_table:
                names, columns = [f"{effect}_{k}" for k in range(term.shape[-1])], self._seen(term)
            else:
                names, columns = self._each_axis(effect, term[:, : len(self.data.letters)])
            seen = np.linalg.norm(columns, axis=(0, 1)) > 1e-9
            names = [name for name, keep in zip(names, seen, strict=True) if keep]
            self._columns[effect] = self._whitened(names, columns[..., seen])
        return self._columns[effect]

    def _system(self, effects: Sequence[str]) -> tuple[list[str], Array, Array, Array]:
        """Names, columns (n, axes, p), whitened rows with those of what is known before, and their targets."""
        parts = [self._base, *(self._of(name) for name in effects), self._errors]
        names = [name for part in parts for name in part[0]]
        rows = np.concatenate([part[2] for part in parts], axis=1)
        known = {**{f"place_{a}": PLACE_M for a in "xyz"}, **dict.fromkeys(self._errors[0], 1.0)}
        before = [np.eye(len(names))[names.index(name)] / size for name, size in known.items()]
        columns = np.concatenate([part[1] for part in parts], axis=-1)
        return names, columns, np.vstack([rows, *before]), np.append(self._target, np.zeros(len(before)))

    def seen(self, effect: str) -> bool:
        """Whether the points can show an effect beside bias, matrix, delay and place."""
        columns = self._of(effect)[2]
        if columns.shape[1] == 0:
            return False
        left = columns - self._base[2] @ np.linalg.lstsq(self._base[2], columns, rcond=None)[0]
        return bool(np.linalg.norm(left) > 1e-6 * np.linalg.norm(columns))

    def fit(self, effects: Sequence[str]) -> RotationFit:
        """Least squares; coefficients that only effects of one column share are those of least norm.

        Raises
        ------
        NotIdentified
            The turns do not tell bias, matrix and delay apart.
        """
        names, columns, rows, target = self._system(effects)
        size = np.linalg.norm(rows, axis=0)
        base = rows[:, : len(self._base[0])] / size[: len(self._base[0])]
        if np.any(size == 0.0) or np.linalg.matrix_rank(base, tol=1e-6) < base.shape[1]:
            raise NotIdentified(
                "rotation: the turns do not tell bias, scale, misalignment and delay apart; turn another plane too"
            )
        left, singular, right = np.linalg.svd(rows / size, full_matrices=False)
        determined = singular > 1e-6 * singular[0]
        value = (right[determined].T @ ((left[:, determined].T @ target) / singular[determined])) / size
        inverse = (right[determined].T / singular[determined] ** 2) @ right[determined] / np.outer(size, size)
        variance, beside, free = self.data.noise_scale
        squares = float(np.sum((target - rows @ value) ** 2)) - beside
        dof = free + (len(target) - len(self._target)) - int(determined.sum())
        total = len(self._target) - free
        # the noise is estimated too: its own scatter widens χ², so that both laws agree where a model is refused
        wide = float(f.isf(ADEQUATE_P, dof, total) * dof / chi2.isf(ADEQUATE_P, dof))
        student = float(t.ppf(0.975, self.data.noise_dof) / norm.ppf(0.975))
        left = max(squares, 0.0) / (variance * wide)
        # slow waves hold more noise than flicker that is known from fast ones: a walk, or what the model lacks
        birge = max(left / max(dof, 1), 1.0)
        return RotationFit(
            tuple(names),
            value + self._offset(names),
            inverse * max(variance, 1.0) * student**2 * birge,
            self.data.output - columns @ value,
            left,
            dof,
            tuple(effects),
        )

    def _offset(self, names: Sequence[str]) -> Array:
        """What the model begins with: the delays."""
        begun = {"delay_outer": self._delay[0], "delay_inner": self._delay[1]}
        return np.array([begun.get(name, 0.0) for name in names])

    def part_of_effects(self, fit: RotationFit) -> Array:
        """What the effects of a fit add to the outputs, (n, axes), g."""
        parts = [self._of(name) for name in fit.effects]
        value = dict(zip(fit.names, fit.value.tolist(), strict=True))
        zero = np.zeros_like(self.data.output)
        return sum((columns @ np.array([value[name] for name in names]) for names, columns, _ in parts), zero)

    def left_out(self, effects: Sequence[str]) -> float:
        """Rms weighted residual of whitened outputs that are left out, every fifth in turn."""
        _, _, rows, target = self._system(effects)
        count, total = len(self._target), 0.0
        number = np.arange(len(target))
        for fold in range(FOLDS):
            out = (number % FOLDS == fold) & (number < count)
            value = np.linalg.lstsq(rows[~out], target[~out], rcond=None)[0]
            total += float(np.sum((target[out] - rows[out] @ value) ** 2))
        return float(np.sqrt(total / count / self.data.noise_scale[0]))
