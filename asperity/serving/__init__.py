"""Solver and surrogates as a server of the UM-Bridge protocol, for other languages and UQ tools.

Source of the protocol: L. Seelinger et al., UM-Bridge: Uncertainty quantification and modeling
bridge, Journal of Open Source Software 8(83), 4748, 2023.
"""
