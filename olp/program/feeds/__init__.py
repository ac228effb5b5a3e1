"""What a program says about time: feeds, dwells, path modes, and feeds written back."""
