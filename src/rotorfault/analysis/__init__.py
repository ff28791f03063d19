"""What can be known before a flight: hover, margins, linearisation, sampling."""
