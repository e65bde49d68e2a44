"""The inquiry: diagnose a run, measure what discriminates between the rival effects, and diagnose all runs together."""
