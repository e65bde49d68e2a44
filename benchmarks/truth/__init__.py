"""Truth for blind runs: physics with memory, geometry, transfer curves and correlated noise.

Nothing here is imported from the product, so that what a diagnosis finds was put there by something else than its own columns.
"""

from . import static, station, temporal, thermal, withheld
from .physics import REGISTRY
from .run import Run, make_run
from .scenarios import SCENARIOS, case
from .spec import Fault, Hidden, Spec, Truth

__all__ = [
    "REGISTRY", "SCENARIOS", "Fault", "Hidden", "Run", "Spec", "Truth", "case", "make_run",
    "static", "station", "temporal", "thermal", "withheld",
]  # fmt: skip
