"""The process that computes: meshes, steps, numbers; everything that may fail, take long or be killed."""
