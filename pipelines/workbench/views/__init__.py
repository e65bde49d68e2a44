"""What pages show: charts and rows from tables of the product; nothing is computed that a command does not compute."""
