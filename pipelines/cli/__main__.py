"""``python -m pipelines.cli``: the command line without an installed package."""

from pipelines.cli import main

main()
