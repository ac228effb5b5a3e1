"""An independent judge of corrected programs: own error model, LinuxCNC as interpreter, own path comparison.

Nothing here imports `olp`: the model is written from the definitions alone, so a wrong sign shows.
"""
