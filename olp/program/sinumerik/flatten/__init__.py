"""Parametric Sinumerik programs unrolled into plain blocks: R-parameters, variables, loops, subprograms."""
