"""Writes results for other programs and later sessions: folders, archives, OpenSim, C3D, Excel, xarray."""
