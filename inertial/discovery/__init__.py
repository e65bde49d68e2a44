"""Effects that an archive of many lots shows and one lot cannot: scores of lots, evidence over them, names."""
