"""Content of pages: charts and rows from tables of the product; every number comes from a function of a command."""
