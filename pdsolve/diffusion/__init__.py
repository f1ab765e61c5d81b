"""Diffusion and dissolution: a concentration, of first order in time, that flows along bonds between nodes.

dH_i/dt = sum_j g_ij V_j (C_j - C_i) + sources, with the content H of a node, mol/m^3, its potential C, and conductances
g. Without dissolution C = H; otherwise see `operator`.
"""
