"""Evidence for what Kinertia claims: `python -m validation --help`, run from the repository; not part of the wheel."""
