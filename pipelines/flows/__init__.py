"""Flows: the chain as Prefect sees it. The only place that imports Prefect."""
