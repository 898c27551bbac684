"""The commands, a module each, and what they share.

:mod:`starting` comes before slow imports, :mod:`commands` finds the command that is wanted, :mod:`entry` has errors,
Ctrl-C and exit codes; beside them :mod:`arguments`, :mod:`console` and :mod:`progress`.
:mod:`computing` says where runs are computed, in :mod:`processes` or on a :mod:`cluster`.
"""
