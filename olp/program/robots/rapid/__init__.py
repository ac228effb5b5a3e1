"""RAPID, the language of ABB robots."""
