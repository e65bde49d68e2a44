"""Presets: what a data sheet says of a kind of device, and what a simulation must add to it."""

import math
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, ValidationError

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.own_files import own_file, own_files
from schemas.strict import Strict
from schemas.toml_files import explain, parse_toml, read_text
from schemas.validity import Stability
from stations.codec import BITS, OUTPUTS, Packing

Positive = Annotated[FiniteFloat, Field(gt=0.0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0.0)]


class Preset(Strict):
    """A kind of device. Standard deviations are those between units; densities are one-sided.

    bias_mean_g, bias_sd_g : of the bias of all axes, or of x, y and z
    noise_bandwidth_hz : of the output filter, one pole; 0 for none: then the converter's own filter ends at half the sample rate
    noise_temperature_per_K : relative change of the white noise per kelvin, about 25 °C
    ratiometric : share of the supply's relative change that the output follows; true is 1

    offset_step : counts of the output per step of its offset registers; 0 for a device without them
    """

    name: str
    description: str
    scale: Positive
    output_unit: Literal["V", "LSB"]
    range_g: Positive
    linearity_pct_fs: NotNegative
    bias_stability_ug: NotNegative
    bias_tempco_ug_per_K: NotNegative
    scale_tempco_ppm_per_K: NotNegative
    temperature_low_C: FiniteFloat
    temperature_high_C: FiniteFloat
    noise_density_ug: NotNegative
    noise_bandwidth_hz: NotNegative = 0.0
    noise_temperature_per_K: FiniteFloat = 0.0
    bias_instability_ug: NotNegative
    rate_random_walk_ug: NotNegative
    bandwidth_hz: Positive
    natural_frequency_hz: Positive
    damping: Positive
    shock_limit_g: Positive
    packing: Packing
    bias_mean_g: FiniteFloat | tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    bias_sd_g: NotNegative | tuple[NotNegative, NotNegative, NotNegative]
    scale_sd_ppm: NotNegative
    misalignment_sd_mrad: NotNegative
    zero_level: FiniteFloat
    ratiometric: Annotated[FiniteFloat, Field(ge=0.0, le=1.0)]
    supply_V: Positive
    thermometer_resolution_K: Positive
    thermometer_noise_K: NotNegative
    offset_step: Annotated[int, Field(ge=0)] = 0
    stability: Stability | None = None

    def with_axes(self, axes: int) -> "Preset":
        """The device with the outputs of its first axes alone, as the reader's converter sends them."""
        if axes == OUTPUTS[self.packing]:
            return self
        packings = [name for name, number in OUTPUTS.items() if number == axes and BITS[name] == BITS[self.packing]]
        if not packings:
            raise RecipeInvalid(
                f"sensor_axes: {axes} of device {self.name}, its digital output sends {OUTPUTS[self.packing]}; leave it out, or "
                "name an analogue device",
                key="sensor_axes",
            )
        return self.model_copy(update={"packing": packings[0]})

    @property
    def passband_hz(self) -> float:
        """−3 dB frequency of the output: that of the sheet, or of the output filter, whose noise bandwidth is π/2 of it."""
        return min(self.bandwidth_hz, 2.0 / math.pi * self.noise_bandwidth_hz or math.inf)

    def sample_noise_ug(self, rate_hz: float) -> float:
        """Standard deviation of the white noise of one sample, µg: density times the root of the noise bandwidth."""
        return self.noise_density_ug * math.sqrt(self.noise_bandwidth_hz or rate_hz / 2.0)

    def sample_correlation(self, rate_hz: float) -> float:
        """Correlation of the white noise of adjacent samples: a pole of noise bandwidth B has the time constant 1/(4B)."""
        return math.exp(-4.0 * self.noise_bandwidth_hz / rate_hz) if self.noise_bandwidth_hz > 0.0 else 0.0

    def sampled_density_ug(self, rate_hz: float) -> float:
        """White noise at low frequencies after sampling, µg/√Hz: what the filter passes above half the rate is folded into it."""
        r = self.sample_correlation(rate_hz)
        return self.sample_noise_ug(rate_hz) * math.sqrt(2.0 / rate_hz * (1.0 + r) / (1.0 - r))

    @property
    def largest_count(self) -> int:
        """The largest code of the converter."""
        return 2 ** (BITS[self.packing] - 1) - 1

    @property
    def lsb(self) -> float:
        """Output units per count: 1 for a digital device; a converter of an analogue one spans its range and a tenth more."""
        if self.output_unit == "LSB":
            return 1.0
        return 1.1 * (abs(self.zero_level) + self.range_g * self.scale) / self.largest_count

    @property
    def full_scale(self) -> float:
        """The largest excursion of the output from zero g, in the output's unit: the range, or the last code before it."""
        return min(self.range_g * self.scale, self.largest_count * self.lsb - abs(self.zero_level))


def preset_names() -> list[str]:
    """Names of the presets, as they are written in their files; those of the user by the names of their files."""
    return sorted({*_texts(), *own_files("presets")})


def load_preset(name: str, overrides: Mapping[str, float] | None = None) -> Preset:
    """The preset of that name (in any case), with some figures replaced; unknown names and keys are refused."""
    texts = {key.lower(): text for key, text in _texts().items()}
    spelled = next((file for file in own_files("presets") if file.lower() == name.lower()), name)
    path = own_file("presets", spelled, {spelled} if spelled.lower() in texts else ())
    if path is None and name.lower() not in texts:
        raise RecipeInvalid(f"device: no preset '{name}'; {did_you_mean(name, preset_names())}", key="device")
    source = f"preset {name}" if path is None else str(path)
    figures = parse_toml(texts[name.lower()] if path is None else read_text(path, "preset"), source)
    if path is not None and str(figures.get("name", "")).lower() != spelled.lower():
        raise RecipeInvalid(
            f"{path}: key 'name': '{figures.get('name', '')}', '{spelled}' as in the name of the file is needed; correct it",
            key="name",
        )
    try:
        return Preset.model_validate(figures | dict(overrides or {}))
    except ValidationError as problem:
        raise explain(problem, source, Preset) from None


def built_in_presets() -> list[str]:
    """Names of the presets of the product, sorted."""
    return sorted(_texts())


def _texts() -> dict[str, str]:
    """The presets of the product by their names."""
    folder = files("stations.plant").joinpath("presets")
    texts = {item.name: item.read_text("utf-8") for item in folder.iterdir() if item.name.endswith(".toml")}
    return {str(tomllib.loads(text)["name"]): text for text in texts.values()}
