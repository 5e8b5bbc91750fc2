"""Describes force plates and synchronisation: their errors, priors of these errors, and corrected loads."""
