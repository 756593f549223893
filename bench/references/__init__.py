"""Solutions that share no code with `bem`, which its answers are compared with.

`half_space` has influence coefficients and convolutions, `dense` solves contact with the whole
matrix, `nnls` is the paper's algorithm. `yielding` has bodies that yield, `edgeless` periodic and
mirrored patches.
"""
