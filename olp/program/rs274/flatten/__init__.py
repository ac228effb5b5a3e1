"""Parametric RS-274 programs unrolled into plain blocks: expressions, loops, subprograms."""
