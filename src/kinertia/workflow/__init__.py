"""Leads from files to a result, for every interface: read, screen, prepare, screen, estimate, judge."""
