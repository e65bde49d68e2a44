"""Stages: pure functions of tables and parameters, without a clock, a file or an orchestrator."""
