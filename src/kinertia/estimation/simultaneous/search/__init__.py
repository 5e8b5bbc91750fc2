"""Finds the estimate: the problem, its linearisation, Gauss-Newton and quasi-Newton steps."""
