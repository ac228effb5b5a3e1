"""Rules of the gate: what a person should know about a correction, as findings."""
