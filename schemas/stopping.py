"""``[stop]`` of a recipe: what must be known of every unit before the lot ends ahead of its plan."""

from typing import ClassVar

from schemas.bounds import Name, Positive, Seconds
from schemas.strict import Grown


class StopTerms(Grown):
    """Expanded uncertainties that are asked for, beside the decisions on the limits.

    bias_ug, scale_ppm, misalignment_urad, bias_temperature_ug_K, scale_temperature_ppm_K : U of the worst axis, by the coverage
        factor of the limits; a figure that is left out need only be decided
    visible : ids of effects that the dwells must be able to show before the lot ends
    longest_dwell_s : longest dwell that the run may choose by the noise so far; the recipe's length stays where None
    """

    later: ClassVar[frozenset[str]] = frozenset(
        {
            *("bias_ug", "scale_ppm", "misalignment_urad", "bias_temperature_ug_K", "scale_temperature_ppm_K"),
            *("visible", "longest_dwell_s"),
        }
    )

    bias_ug: Positive | None = None
    scale_ppm: Positive | None = None
    misalignment_urad: Positive | None = None
    bias_temperature_ug_K: Positive | None = None
    scale_temperature_ppm_K: Positive | None = None
    visible: list[Name] = []
    longest_dwell_s: Seconds | None = None

    @property
    def asked(self) -> dict[str, float]:
        """Expanded uncertainties asked for by effect, µg per unit of the coefficient."""
        given = {
            "bias": self.bias_ug,
            "scale": self.scale_ppm,
            "misalignment": self.misalignment_urad,
            "bias_temperature": self.bias_temperature_ug_K,
            "scale_temperature": self.scale_temperature_ppm_K,
        }
        return {effect: value for effect, value in given.items() if value is not None}
