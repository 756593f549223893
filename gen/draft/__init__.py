"""Scenes for a folder of measured maps: survey the maps, then write the scene that suits them."""
