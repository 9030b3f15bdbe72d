"""The data model: parameters, cases, meshes, results."""
