"""KRL, the language of KUKA robots."""
