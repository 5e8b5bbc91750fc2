"""People whose body segment parameters are known, and laboratories that measure them with known errors."""
