"""The stages in order, the runner, and the attendance of the operator."""
