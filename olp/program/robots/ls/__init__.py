"""TP programs of FANUC robots as text (LS)."""
