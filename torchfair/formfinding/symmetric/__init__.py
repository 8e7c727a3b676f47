"""The job that designs principal-symmetric meshes (paper section 5.2)."""
