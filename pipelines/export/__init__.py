"""Export of coefficients for firmware, autopilots and spreadsheets. a = K(θ)⁻¹·(ã − b(θ)), θ = T − 25 °C."""

from pipelines.export.formats import FORMATS, export_files
from pipelines.export.polynomials import UnitCalibration, revoked_units, unit_calibrations
from pipelines.export.settings import ExportSettings, device_ids

__all__ = [
    "FORMATS",
    "ExportSettings",
    "UnitCalibration",
    "device_ids",
    "export_files",
    "revoked_units",
    "unit_calibrations",
]
