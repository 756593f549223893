"""Random forces and mean pressures on random surfaces, cells and tolerances."""
