"""Scenes for people's own maps: what a folder of maps holds, and which scene suits it."""
