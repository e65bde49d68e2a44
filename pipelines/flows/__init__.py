"""Flows of Prefect: order, retries and schedules of the chain."""
