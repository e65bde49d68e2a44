"""A lot of the simulated station with a physical effect that is not told, to try the loop on."""

from __future__ import annotations

from dataclasses import dataclass, field

from tumbleline.recordings import Recording, read


@dataclass(frozen=True)
class Example:
    """Four units that were measured twice; an effect is hidden in them.

    run, fresh : the first and the second measurement · model : to begin with
    """

    run: Recording
    fresh: Recording
    model: list[str]
    _truth: tuple[str, str] = field(repr=False)

    def reveal(self) -> str:
        """The hidden effect and its physics."""
        effect, physics = self._truth
        return f"{effect}: {physics}"


def example(effect: str = "random", *, seed: int = 11) -> Example:
    """A lot with a hidden effect, measured twice on the simulated station, as ``tumbleline demo``.

    Parameters
    ----------
    effect : an effect that ``tumbleline demo`` knows, or ``random``
    seed : the same seed gives the same data
    """
    from pipelines.demo.measure import measure
    from pipelines.demo.scenes import scene

    hidden = scene(effect, seed)
    lot = measure(hidden, seed)
    runs = read(lot.dwells, history=lot.history), read(lot.fresh, history=lot.fresh_history)
    return Example(*runs, list(hidden.model), (hidden.effect, hidden.truth))
