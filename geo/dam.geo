// dam.geo - the scene in the dimension that the parameter dim asks for.

Include "../pro/parameters.pro";
Include "../pro/check.pro";
Mesh.MshFileVersion = 2.2;  // what a GetDP without Gmsh's library reads
If(dim == 3)
  Include "dam3d.geo";
Else
  Include "dam2d.geo";
EndIf
