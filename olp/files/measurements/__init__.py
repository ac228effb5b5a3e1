"""Files of measurements: plans, readings of instruments, profiles of their layouts."""
