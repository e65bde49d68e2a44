from inertial.dynamics.rotation_effects.base import Array, Nodes, RotationEffect


class SampleClock(RotationEffect):
    """Samples by a clock that is not that of the encoder's readings."""

    equation = "ε·(t − t₀)·df/dt"
    source = "mechanism: quartz of the reader against that of the station"
    unit = "ppm"
    breaker = "the clock of the reader against that of the station over an hour"
    of_table = True

    def columns(self, at: Nodes) -> Array:
        return (at.points.rate * (at.points.time - at.points.time[0]))[:, None, None] * at.slope[..., None]
