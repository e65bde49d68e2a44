"""The panels of each unit in a run's report: each module states ORDER and TITLE and renders one part."""
