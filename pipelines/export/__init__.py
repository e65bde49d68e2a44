"""Export of coefficients for firmware, autopilots and spreadsheets. a = K(θ)⁻¹·(ã − b(θ)), θ = T − 25 °C."""

from pipelines.export.formats import FORMATS, export_text
from pipelines.export.polynomials import UnitCalibration, revoked_units, unit_calibrations

__all__ = ["FORMATS", "UnitCalibration", "export_text", "revoked_units", "unit_calibrations"]
