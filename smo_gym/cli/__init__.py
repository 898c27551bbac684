"""What all commands share: :mod:`entry` (errors, Ctrl-C, exit codes), :mod:`arguments`, :mod:`console`.

:mod:`computing` says where runs are computed, in :mod:`processes` or on a :mod:`cluster`.
"""
