"""Figures that readings give by themselves: ISO 230-2, 230-4 and 230-6, squareness, reversal."""
