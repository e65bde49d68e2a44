from inertial.data_errors.changes import OfOneUnit
from inertial.data_errors.handling.not_soaked import NotSoaked


class UnitNotSoaked(OfOneUnit, NotSoaked):
    """A temperature of one unit that relaxes to the reading with its own time constant."""

    id = "unit_not_soaked"
    equation = "E(T_d) − E(T), T_d′ = (T − T_d)/τ, one unit"
    fewest_units = 2
