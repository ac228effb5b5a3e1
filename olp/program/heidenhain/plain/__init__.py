"""Motion that a Heidenhain control makes from several statements, written out as L, CC, C and CP."""
