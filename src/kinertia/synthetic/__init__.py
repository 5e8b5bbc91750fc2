"""Makes people of known body segment parameters, and laboratories that measure them with known errors."""
