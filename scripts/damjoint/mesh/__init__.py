"""Meshes: made by Gmsh or a user's own, their regions, joints and surfaces."""
