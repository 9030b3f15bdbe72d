// Made by python -m damjoint_tools.gmsh_files, for dim = 2.
Include "../geo/window.geo";
Include "../geo/blocks.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {2};
Physical Point(8) = {1};
Physical Point(9) = {6};
Physical Point(1007) = {1};
Physical Point(1008) = {3};
Physical Point(2007) = {4};
Physical Point(2008) = {1};
Physical Curve(3) = {2};
Physical Curve(6) = {9};
Physical Curve(1003) = {3};
Physical Curve(2003) = {1};
Physical Surface(1) = {1};
Physical Surface(2) = {3};
Physical Surface(1001) = {2};
