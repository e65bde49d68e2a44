"""The registers of the memory of a simulated device."""

from __future__ import annotations

from dataclasses import dataclass

from stations.codec import NotEncodable, Value
from stations.plant.bank import Busy, Source, number
from stations.plant.flash import Flash
from stations.plant.world import World

PART = 64
PARTS = 3


@dataclass
class MemoryBank:
    """Memory registers of the device in a slot, by the place of the slot."""

    world: World
    place: int

    @property
    def unit(self) -> int:
        """The unit that is seated in the slot."""
        return self.world.seats[self.place]

    @property
    def flash(self) -> Flash:
        """Its memory."""
        return self.world.flash[self.unit]

    def sources(self) -> dict[str, Source]:
        """Values of the registers."""
        sources: dict[str, Source] = {
            "memory_state": lambda: self.flash.state(self.world.now_us),
            "memory_command": lambda: 0,
            "erases_a": lambda: self.flash.erases[0],
            "erases_b": lambda: self.flash.erases[1],
            "endurance": lambda: self.flash.endurance,
            "offset_step": lambda: self.world.preset.offset_step,
            "offset": lambda: [float(step) for step in self.flash.offsets],
        }
        for part in range(PARTS):
            sources[f"buffer_{part}"] = lambda part=part: _part(self.flash.buffer, part)
            for copy, name in enumerate("ab"):
                sources[f"copy_{name}_{part}"] = lambda part=part, copy=copy: _part(
                    self.flash.read(copy, self.world.now_us), part
                )
        return sources

    def write(self, values: dict[str, Value]) -> None:
        """Applies writes; a device that has no power, or is sampling, refuses them."""
        if values and (not self.world.powered or self.world.sampler.running):
            raise Busy("memory")
        for name, value in values.items():
            if name.startswith("buffer_") and isinstance(value, list):
                part = int(name.removeprefix("buffer_"))
                self.flash.buffer[part * PART : (part + 1) * PART] = [int(word) for word in value]
            elif name == "offset" and isinstance(value, list):
                if not self.world.preset.offset_step:
                    raise NotEncodable("offset: the device has no offset registers")
                self.world.set_offsets(self.unit, [int(step) for step in value])
            elif name == "memory_command" and (command := int(number(values, name))):
                if self.flash.state(self.world.now_us) == 1:
                    raise Busy("memory")
                self.world.program_memory(self.unit, command - 1)


def _part(words: list[int], part: int) -> list[float]:
    return [float(word) for word in words[part * PART : (part + 1) * PART]]
