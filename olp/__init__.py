"""`olp` pre-distorts programs of Cartesian machines with the machine's calibrated error model."""

__version__ = "0.1.0"
