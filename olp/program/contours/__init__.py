"""Contours under cutter compensation (G41, G42): the path of the tool that a control makes of them."""
