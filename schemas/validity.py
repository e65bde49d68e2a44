"""``[stability]`` of a device and ``[certificate]`` of a recipe: what changes beyond the run, what is certified for how long."""

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from schemas.bounds import Celsius, NotNegative, Number, Positive, Seconds, Text
from schemas.strict import OnlyStated, Strict


class Ageing(Strict):
    """Change of the bias with time: logarithmic, linear, a walk, or a walk that is bounded.

    per_decade_ug : per decade of days; per_year_ug : linear; walk_ug_rtday : K per root of a day; deviation_ug and
    correlation_days : of a bounded walk
    """

    form: Literal["log", "linear", "walk", "bounded"]
    per_decade_ug: NotNegative | None = None
    per_year_ug: NotNegative | None = None
    walk_ug_rtday: NotNegative | None = None
    deviation_ug: NotNegative | None = None
    correlation_days: Positive | None = None

    @model_validator(mode="after")
    def _complete(self) -> "Ageing":
        needed = {
            "log": ("per_decade_ug",), "linear": ("per_year_ug",), "walk": ("walk_ug_rtday",),
            "bounded": ("deviation_ug", "correlation_days"),
        }[self.form]  # fmt: skip
        missing = [name for name in needed if getattr(self, name) is None]
        if missing:
            raise ValueError(f"{missing[0]}: missing, ageing of form {self.form} needs it; add it")
        return self


class Stability(OnlyStated):
    """What a kind of device does beyond a run.

    switch_on_ug, switch_on_ppm : standard deviation of bias and scale from one switch-on to the next
    power_cycles : number of switch-ons that it is known from
    flicker_slowest_s : slowest time constant of the flicker as history shows it; where it is not stated flicker goes on to the
        due date
    horizon_days : longest period that the figures hold for
    temperature_of : whose temperature the user corrects with
    ratiometric : share of the supply's relative change that the output follows; true is 1
    supply_V : nominal supply, to which the output is referred where the supply is measured
    zero_level_g : nominal output at 0 g over the scale: what the supply and the gain of the reader act on at 0 g
    bias_temperature_ug_K, scale_temperature_ppm_K : for models without temperature terms
    exact : nothing changes beyond the run; for simulated stations only
    """

    switch_on_ug: NotNegative = 0.0
    switch_on_ppm: NotNegative = 0.0
    power_cycles: Annotated[int, Field(ge=2)] | None = None
    ageing: Ageing | None = None
    flicker_slowest_s: Positive | None = None
    horizon_days: Positive
    source: Literal["history", "data_sheet"]
    temperature_of: Literal["device", "slot", "chamber"] = "device"
    ratiometric: Annotated[FiniteFloat, Field(ge=0.0, le=1.0)] = 0.0
    supply_V: Positive | None = None
    zero_level_g: Number = 0.0
    bias_temperature_ug_K: NotNegative = 0.0
    scale_temperature_ppm_K: NotNegative = 0.0
    note: Text = ""


class CertificateTerms(OnlyStated):
    """The table ``[certificate]`` of a recipe: what is certified.

    validity_months : period that the figures are stated for; customer_agreed : whether a due date may be printed
    force_range_g, temperature_range_C : range in which the corrected output is certified; that of the recipe where not stated
    use_window_s : time over which a user averages; a dwell where not stated
    frame : ``intrinsic``: the sensor's own axes, a rotation of the whole unit is no error and is not
        certified; ``fixture``: it is
    """

    validity_months: Annotated[int, Field(strict=True, ge=1, le=120)] = 12
    customer_agreed: bool = False
    force_range_g: tuple[Number, Number] | None = None
    temperature_range_C: tuple[Celsius, Celsius] | None = None
    use_window_s: Seconds | None = None
    frame: Literal["fixture", "intrinsic"] = "intrinsic"

    @model_validator(mode="after")
    def _ordered(self) -> "CertificateTerms":
        for name in ("force_range_g", "temperature_range_C"):
            bounds = getattr(self, name)
            if bounds is not None and bounds[0] >= bounds[1]:
                raise ValueError(f"{name}: {bounds[0]:g} is not below {bounds[1]:g}; give the lower bound first")
        return self
