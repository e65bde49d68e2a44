"""Statistics of the audit, one method a file: numpy and scipy only, apart from the science, whose code decides coefficients."""
