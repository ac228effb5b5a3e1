"""What every room shares: errors, units, arrays, interpolation, the machine and a toolpath as values."""
