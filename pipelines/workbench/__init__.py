"""The workbench: the archive, the model and what is missing, on pages of a local web application."""
