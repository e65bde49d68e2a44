"""Monitoring of a line: numbers for Prometheus, one verdict for health checks, and alerts to a web hook."""
