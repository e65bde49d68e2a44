"""The estimate of a lot: its model, the noise of its dwells, their covariance, and the likelihood of a model."""
