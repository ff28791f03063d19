"""Where the vehicle should be, as functions of time."""
