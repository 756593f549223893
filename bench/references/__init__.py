"""Reference solutions that share no code with `bem`; the answers of `bem` are compared with them.

`half_space` has influence coefficients and convolutions. `dense` solves contact with the whole
matrix, also with a hardness and by the paper's algorithm. `edgeless` solves periodic and mirrored
patches. `exact` computes the statistics of a surface in fractions, `surfaces` draws surfaces.
"""
