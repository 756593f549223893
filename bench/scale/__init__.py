"""How far the farm scales: its costs measured here, and a simulation of many more ranks."""
