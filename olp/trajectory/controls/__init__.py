"""How long controls take for a program, by what is published of their planners."""
