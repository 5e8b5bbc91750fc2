"""Describes force plates and synchronisation: their errors, priors of these errors, and corrected loads.

A load w = (F, M) of a plate, about the ground origin, becomes f by the errors of the plate: zero offsets z at its
middle c, rotation phi about the vertical there, displacement d in the floor's plane, free moment per vertical force k,
relative gain g, and by the delay tau of the forces (`plates`):

    w1 = w - (z, c x z)         w2 = w1 rotated by phi about the vertical through c
    w3 = w2 moved by d          w4 = w3 + (0, k F_y up)          f(t) = (1 + g) w4(t + tau)

Errors are fault-free with one SD or faulty with a larger one (`mixture_prior`, `priors`). They are reported as recorded
minus true (`instrument_errors`). Frames in which f changes faster than q can follow count less (`impacts`).
"""
