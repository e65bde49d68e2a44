"""``python -m pipelines.cli``: the command line where the package is not installed."""

from pipelines.cli import main

main()
