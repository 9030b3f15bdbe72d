// dam.geo - the mesh of the section by parameters, in 2D or 3D (parameter dim).

Include "../pro/parameters.pro";
Include "../pro/check.pro";
Mesh.MshFileVersion = 2.2;  // read by GetDP without Gmsh's library, too
If(dim == 3)
  Include "dam3d.geo";
Else
  Include "dam2d.geo";
EndIf
