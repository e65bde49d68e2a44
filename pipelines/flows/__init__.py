"""Flows of Prefect: order, retries and schedules of the chain. Only this package imports Prefect."""
