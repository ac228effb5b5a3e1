"""Programs on machines with rotary joints: their path in all axes, its correction, and its text."""
