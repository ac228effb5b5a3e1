"""INFORM, the language of Yaskawa Motoman robots (JBI)."""
