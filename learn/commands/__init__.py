"""The commands of `python -m learn`. Each module imports only what its commands need.

`options` holds the options that several commands share.
"""
