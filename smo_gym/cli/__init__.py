"""What all commands share: :mod:`entry` (errors, Ctrl-C, exit codes), :mod:`arguments` and :mod:`console`."""
