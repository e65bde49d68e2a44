"""The next measurement: what separates the candidates that the data do not, and what it costs."""
