"""The calibration certificate that is handed out: its content (ISO/IEC 17025, 7.8.2 and 7.8.4), as XML and as PDF."""
