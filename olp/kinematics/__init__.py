"""Machines of any joints: serial chains from workpiece to tool, and platforms on legs."""
