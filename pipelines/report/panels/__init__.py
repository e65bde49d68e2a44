"""The panels of a run's report: each module states ORDER and TITLE and renders one part of the page."""
