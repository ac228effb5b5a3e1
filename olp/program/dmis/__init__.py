"""DMIS part programs of coordinate measuring machines (ISO 22093)."""
