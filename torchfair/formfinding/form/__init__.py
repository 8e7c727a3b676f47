"""The job that finds surfaces of least C with given boundary (paper section 5.3)."""
