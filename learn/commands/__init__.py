"""The commands of `python -m learn`. Each module imports only what its commands need.

`options` holds the options that several commands share, `option_groups` what turns a group of them
into one argument of a command.
"""
