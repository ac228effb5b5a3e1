"""APT and cutter-location data (ISO 4343, ISO 3592)."""
