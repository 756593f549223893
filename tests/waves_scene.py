"""A small scene of smooth waves under light pressures, without edges."""

SCENE = """
samples = 4
[surface]
generator = "spectral"
nodes = 33
side = 1000.0
hurst = 0.8
roll_off = 250.0
cut_off = 250.0
rms_slope = 0.1
[load]
quantity = "pressure"
range = [0.001, 0.02]
[contact]
boundary = "periodic"
"""
