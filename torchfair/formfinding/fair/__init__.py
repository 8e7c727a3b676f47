"""The job that lowers E near a reference surface (paper section 5.1)."""
