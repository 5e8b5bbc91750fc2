"""Reads and writes text files: tables of OpenSim, and exports of Vicon, Qualisys and Cortex."""
