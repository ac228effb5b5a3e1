"""What the configuration of a control states of its machine: one module a format."""
