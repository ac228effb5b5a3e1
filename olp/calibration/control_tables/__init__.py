"""What a control does with compensation tables, and what they leave."""
