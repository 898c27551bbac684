"""The environments: ``pendulum.py`` (scalar), ``vector.py`` (native vector) and what both share, ``task.py``."""
