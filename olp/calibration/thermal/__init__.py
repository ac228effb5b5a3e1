"""The thermal structure of a machine, identified from logs of sensors and drift."""
