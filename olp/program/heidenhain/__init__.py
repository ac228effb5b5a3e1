"""Heidenhain conversational programs (`.h`): blocks of L, CC, C, CR, CP, cycles, labels and Q parameters."""
