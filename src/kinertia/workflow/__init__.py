"""The one road from files to a result: read, screen, prepare, screen, estimate, judge."""
