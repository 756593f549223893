"""Generate databases of rough-surface contact: scenes, surfaces, statistics, farm, database."""
