"""What is asked: parameters, case files, meshes."""
