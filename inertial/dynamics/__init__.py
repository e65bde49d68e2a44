"""Mathematics of dynamic and single-axis tests: transfer functions, pulses, spectra, centrifuge, tilt, stability."""
