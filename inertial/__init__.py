"""The science of accelerometer calibration: arrays in, arrays out. Units: g, °C, s, radians."""
