"""Re-analysis of the archive: runs with the present code or another model, and differences between runs."""
