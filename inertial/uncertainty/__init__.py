"""What a calibration is worth: contributions, their propagation through the fit, the period, the risk of decisions."""
