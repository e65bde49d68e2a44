"""The workbench: archive, models and missing effects, on pages of a local web application."""
