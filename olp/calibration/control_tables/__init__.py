"""What a control does with compensation tables, and the errors that remain."""
