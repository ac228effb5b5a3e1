"""VAL 3, the language of Stäubli: programs (`.pgx`), data (`.dtx`) and projects (`.pjx`), all of them XML."""
