"""Readers and writers of laboratory files: one module per format.

Millimetres, degrees and lab axes exist only in here; what comes out is in SI units and ground axes (X
forward, Y up, Z right).
"""
