"""Solutions that share no code with `bem`, which its answers are compared with.

`half_space` has influence coefficients and convolutions, `dense` solves contact with the whole
matrix, also as the paper does and with a hardness, `edgeless` periodic and mirrored patches.
"""
