"""Languages of robots: targets that moves use by name or state themselves, in frames and with tools."""
