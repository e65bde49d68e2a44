"""Diagnosis: is the model adequate, which effect is missing, which measurement decides."""
