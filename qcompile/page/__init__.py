"""Reports: what a result says, as one HTML page that holds everything it shows."""
