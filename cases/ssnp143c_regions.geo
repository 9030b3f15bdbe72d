// Made by python -m damjoint_tools.gmsh_files, for dim = 2.
Include "../geo/window.geo";
Include "../geo/pressed.geo";
If(dim != 2)
  Error("dim = %g: must be 2, as the regions in this file", dim);
EndIf
Mesh.MshFileVersion = 2.2;
Delete Physicals;
Physical Point(7) = {4};
Physical Point(8) = {1};
Physical Point(9) = {6};
Physical Point(1007) = {5};
Physical Point(1008) = {2};
Physical Point(2007) = {3};
Physical Point(2008) = {6};
Physical Curve(3) = {1};
Physical Curve(6) = {12 : 14};
Physical Curve(1003) = {2};
Physical Curve(2003) = {3};
Physical Surface(1) = {1};
Physical Surface(2) = {3};
Physical Surface(1001) = {2};
