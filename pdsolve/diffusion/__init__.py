"""Diffusion and dissolution: a concentration, of first order in time, that links between nodes make even.

dH_i/dt = sum_j g_ij V_j (C_j - C_i) + what is supplied, with the content H of a node, mol/m^3, its potential C, and
conductances g. Where nothing dissolves C = H; see `dissolution` for where something does.
"""
