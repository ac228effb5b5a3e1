"""Proof by reading back: what was written, run through the forward model beside the nominal path."""
