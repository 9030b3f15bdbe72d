"""Pictures: the shapes of a scene, for matplotlib and for Gmsh; section, joint, history, check."""
