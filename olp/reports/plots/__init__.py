"""Static plots as SVG or PNG bytes."""
